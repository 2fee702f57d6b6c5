use super::*;
use crate::irq::Irq;

const PERIOD: u32 = 2400;

fn write(tcc: &mut Tcc, ctx: &mut Context, offset: u32, value: u32) {
    let width = match offset {
        CTRLBCLR | CTRLBSET | DBGCTRL => Width::Byte,
        PATT | PATTBUF => Width::Half,
        _ => Width::Word,
    };
    tcc.write(offset, width, value, ctx);
    while tcc.read(SYNCBUSY, Width::Word, ctx) != 0 {
        ctx.now += 1;
    }
}

fn tcc(index: usize) -> (Tcc, Context) {
    let (mut tcc, mut ctx) = (Tcc::new(index), Context::default());
    ctx.clocks.cpu_ticks = 1;
    ctx.clocks.generic[INSTANCES[index].1] = Some(Hertz(48_000_000));
    tcc.notice(&mut ctx);
    (tcc, ctx)
}

/// TCC0 makes pulses of 20 kHz; on a fault outputs 0 and 6 are driven low.
fn pulsing() -> (Tcc, Context) {
    let (mut tcc, mut ctx) = tcc(0);
    write(&mut tcc, &mut ctx, WAVE, NPWM);
    write(&mut tcc, &mut ctx, PER, PERIOD - 1);
    write(&mut tcc, &mut ctx, DRVCTRL, 1 << 0 | 1 << 6);
    write(&mut tcc, &mut ctx, DBGCTRL, FDDBD);
    write(&mut tcc, &mut ctx, CTRLA, ENABLE);
    (tcc, ctx)
}

fn overflow(tcc: &mut Tcc, ctx: &mut Context) {
    ctx.now = tcc.counter.next_overflow().expect("it counts");
    tcc.advance(ctx);
}

fn duty(ctx: &Context, output: usize) -> f32 {
    ctx.wires.pwm[0][output].duty
}

#[test]
fn a_buffered_duty_cycle_takes_effect_at_the_end_of_the_period() {
    let (mut tcc, mut ctx) = pulsing();
    assert_eq!(tcc.next_event(), None);
    tcc.write(CCBUF, Width::Word, 600, &mut ctx);
    tcc.write(CCBUF + 8, Width::Word, PERIOD, &mut ctx);
    assert_eq!(tcc.read(STATUS, Width::Word, &mut ctx), STATUS_CCBUFV | STATUS_CCBUFV << 2);
    assert_eq!(duty(&ctx, 0), 0.0);
    ctx.now = tcc.next_event().expect("the end of the period");
    tcc.advance(&mut ctx);
    assert_eq!([duty(&ctx, 0), duty(&ctx, 1), duty(&ctx, 2), duty(&ctx, 6)], [0.25, 0.0, 1.0, 1.0]);
    assert_eq!((ctx.wires.pwm[0][0].period, tcc.next_event()), (PERIOD, None));
    assert_eq!(tcc.read(STATUS, Width::Word, &mut ctx), 0);
    assert_eq!(ctx.violations(), []);
}

#[test]
fn while_updates_are_locked_buffers_wait() {
    let (mut tcc, mut ctx) = pulsing();
    write(&mut tcc, &mut ctx, CTRLBSET, LUPD);
    tcc.write(CCBUF, Width::Word, 600, &mut ctx);
    assert_eq!(tcc.next_event(), None);
    overflow(&mut tcc, &mut ctx);
    assert_eq!(duty(&ctx, 0), 0.0);
    write(&mut tcc, &mut ctx, CTRLBCLR, LUPD);
    overflow(&mut tcc, &mut ctx);
    assert_eq!(duty(&ctx, 0), 0.25);
}

#[test]
fn off_it_lets_go_of_its_pins() {
    let (mut tcc, mut ctx) = pulsing();
    assert!(ctx.wires.pwm[0][0].driven);
    write(&mut tcc, &mut ctx, CTRLA, 0);
    assert!(!ctx.wires.pwm[0][0].driven);
}

#[test]
fn a_fault_drives_outputs_to_their_safe_level_until_it_is_cleared() {
    let (mut tcc, mut ctx) = pulsing();
    write(&mut tcc, &mut ctx, CC, 1200);
    tcc.debugger_halted(&mut ctx);
    let pwm = &ctx.wires.pwm[0];
    assert_eq!((pwm[0].duty, pwm[0].driven, pwm[0].faulted, pwm[1].driven), (0.0, true, true, false));
    write(&mut tcc, &mut ctx, STATUS, STATUS_DFS);
    assert_eq!((duty(&ctx, 0), ctx.wires.pwm[0][0].faulted), (0.5, false));
}

#[test]
fn a_pattern_overrides_the_pulses() {
    let (mut tcc, mut ctx) = pulsing();
    write(&mut tcc, &mut ctx, PATT, 1 << 3 | 1 << 11);
    assert_eq!([duty(&ctx, 2), duty(&ctx, 3)], [0.0, 1.0]);
}

#[test]
fn overflow_interrupts_once_a_period() {
    let (mut tcc, mut ctx) = pulsing();
    write(&mut tcc, &mut ctx, INTENSET, OVF);
    let first = tcc.next_event().expect("it overflows");
    ctx.now = first;
    tcc.advance(&mut ctx);
    assert_eq!(ctx.lines, Irq::Tcc0.bit());
    tcc.write(INTFLAG, Width::Word, OVF, &mut ctx);
    assert_eq!((ctx.lines, tcc.next_event()), (0, Some(first + u64::from(PERIOD))));
}

#[test]
fn count_reads_stale_until_readsync() {
    let (mut tcc, mut ctx) = pulsing();
    ctx.now += 1000;
    assert_eq!(tcc.read(COUNT, Width::Word, &mut ctx), 0);
    write(&mut tcc, &mut ctx, CTRLBSET, 4 << 5);
    assert!(tcc.read(COUNT, Width::Word, &mut ctx) >= 1000);
}

#[test]
fn a_duty_cycle_is_not_written_while_the_last_one_is_crossing() {
    let (mut tcc, mut ctx) = pulsing();
    tcc.write(CC, Width::Word, 10, &mut ctx);
    tcc.write(CC, Width::Word, 20, &mut ctx);
    assert_eq!((ctx.violations()[0].kind, tcc.cc[0]), (Kind::SyncBusy, 10));
}

#[test]
fn what_happens_on_a_fault_is_fixed_while_enabled() {
    let (mut tcc, mut ctx) = pulsing();
    write(&mut tcc, &mut ctx, DRVCTRL, 0);
    assert_eq!(ctx.violations()[0].kind, Kind::EnableProtected);
}

#[test]
fn without_its_generic_clock_a_write_is_reported() {
    let (mut tcc, mut ctx) = (Tcc::new(0), Context::default());
    tcc.write(PER, Width::Word, 10, &mut ctx);
    assert_eq!(ctx.violations()[0].kind, Kind::Unclocked);
}

#[test]
fn the_smaller_timers_have_fewer_channels() {
    let (mut tcc, mut ctx) = tcc(1);
    write(&mut tcc, &mut ctx, CC + 8, 10);
    assert_eq!(ctx.violations()[0].kind, Kind::NoRegister);
}
