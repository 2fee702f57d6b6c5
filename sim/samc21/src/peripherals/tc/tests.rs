use super::*;
use crate::irq::Irq;

/// TC4 at 48 MHz.
fn tc4() -> (Tc, Context) {
    on(4, 32, 48_000_000)
}

/// TC0 at 16 MHz, with the bus clock of TC1.
fn tc0() -> (Tc, Context) {
    let (tc, mut ctx) = on(0, 30, 16_000_000);
    ctx.clocks.apb[2] = 1 << 12 | 1 << 13;
    (tc, ctx)
}

fn on(index: usize, channel: usize, hertz: u32) -> (Tc, Context) {
    let (mut tc, mut ctx) = (Tc::new(index), Context::default());
    ctx.clocks.cpu_ticks = 1;
    ctx.clocks.generic[channel] = Some(Hertz(hertz));
    tc.notice(&mut ctx);
    (tc, ctx)
}

fn settle(tc: &mut Tc, ctx: &mut Context) {
    while tc.read(SYNCBUSY, Width::Word, ctx) != 0 {
        ctx.now += 1;
    }
}

fn write(tc: &mut Tc, ctx: &mut Context, offset: u32, value: u32) {
    let width = match offset {
        CTRLA => Width::Word,
        COUNT | CC if tc.ctrla & MODE == MODE_32 => Width::Word,
        COUNT | CC | CCBUF => Width::Half,
        _ => Width::Byte,
    };
    tc.write(offset, width, value, ctx);
    settle(tc, ctx);
}

/// Counts to `top` again and again.
fn matching(top: u32) -> (Tc, Context) {
    let (mut tc, mut ctx) = tc4();
    write(&mut tc, &mut ctx, WAVE, 1);
    write(&mut tc, &mut ctx, CC, top);
    write(&mut tc, &mut ctx, INTENSET, MC);
    write(&mut tc, &mut ctx, CTRLA, ENABLE);
    (tc, ctx)
}

/// 32 bits at 1 MHz.
fn microseconds() -> (Tc, Context) {
    let (mut tc, mut ctx) = tc0();
    write(&mut tc, &mut ctx, CTRLA, MODE_32 | 4 << 8);
    write(&mut tc, &mut ctx, CTRLA, MODE_32 | 4 << 8 | ENABLE);
    (tc, ctx)
}

fn count(tc: &mut Tc, ctx: &mut Context) -> u32 {
    write(tc, ctx, CTRLBSET, 4 << 5);
    tc.read(COUNT, Width::Word, ctx)
}

#[test]
fn count_reads_stale_until_readsync() {
    let (mut tc, mut ctx) = microseconds();
    ctx.now += Cycles::from_micros(50).0;
    assert_eq!(tc.read(COUNT, Width::Word, &mut ctx), 0);
    tc.write(CTRLBSET, Width::Byte, 4 << 5, &mut ctx);
    assert_eq!(tc.read(CTRLBSET, Width::Byte, &mut ctx), 4 << 5);
    assert_eq!(tc.read(COUNT, Width::Word, &mut ctx), 0);
    settle(&mut tc, &mut ctx);
    assert_eq!((tc.read(CTRLBSET, Width::Byte, &mut ctx), tc.read(COUNT, Width::Word, &mut ctx)), (0, 50));
    ctx.now += Cycles::from_micros(50).0;
    assert_eq!(tc.read(COUNT, Width::Word, &mut ctx), 50);
    assert_eq!(ctx.violations(), []);
}

#[test]
fn match_frequency_interrupts_every_period() {
    let (mut tc, mut ctx) = matching(4799);
    let first = tc.next_event().expect("it counts");
    for n in 0..10 {
        ctx.now = first + 4800 * n;
        assert_eq!(tc.next_event(), Some(ctx.now));
        tc.advance(&mut ctx);
        assert_eq!(ctx.lines, Irq::Tc4.bit());
        assert_eq!(tc.next_event(), None);
        tc.write(INTFLAG, Width::Byte, MC, &mut ctx);
        assert_eq!(ctx.lines, 0);
    }
    assert_eq!(ctx.violations(), []);
}

#[test]
fn a_compare_flag_comes_one_count_after_the_match() {
    let (mut tc, mut ctx) = microseconds();
    let start = ctx.now;
    tc.write(CC, Width::Word, 1000, &mut ctx);
    tc.write(INTENSET, Width::Byte, MC, &mut ctx);
    let at = tc.next_event().expect("it will match");
    assert!((1000..1002).contains(&((at - start) / 48)));
    ctx.now = Cycles(at.0 - 1);
    assert_eq!(tc.read(INTFLAG, Width::Byte, &mut ctx) & MC, 0);
    ctx.now = at;
    assert_eq!(tc.read(INTFLAG, Width::Byte, &mut ctx) & MC, MC);
    assert_eq!(count(&mut tc, &mut ctx), 1001);
}

#[test]
fn flags_nobody_waits_for_are_there_for_who_looks() {
    let (mut tc, mut ctx) = tc4();
    write(&mut tc, &mut ctx, CTRLA, ENABLE);
    assert_eq!(tc.next_event(), None);
    ctx.now += 0x1_0000;
    assert_eq!(tc.read(INTFLAG, Width::Byte, &mut ctx) & OVF, OVF);
}

#[test]
fn retrigger_starts_over_and_stop_stands() {
    let (mut tc, mut ctx) = microseconds();
    ctx.now += Cycles::from_micros(500).0;
    write(&mut tc, &mut ctx, CTRLBSET, 1 << 5);
    assert_eq!(count(&mut tc, &mut ctx), 0);
    ctx.now += Cycles::from_micros(100).0;
    write(&mut tc, &mut ctx, CTRLBSET, 2 << 5);
    assert_eq!(tc.read(STATUS, Width::Byte, &mut ctx), STATUS_STOP);
    ctx.now += Cycles::from_micros(100).0;
    assert!((100..102).contains(&count(&mut tc, &mut ctx)));
}

#[test]
fn one_shot_stops_at_the_overflow() {
    let (mut tc, mut ctx) = matching(99);
    write(&mut tc, &mut ctx, CTRLBSET, ONESHOT);
    ctx.now += 10_000;
    assert_eq!(tc.read(STATUS, Width::Byte, &mut ctx), STATUS_STOP);
    assert_eq!(tc.next_event(), None);
}

#[test]
fn a_buffered_period_is_taken_over_at_the_overflow() {
    let (mut tc, mut ctx) = matching(4799);
    let first = tc.next_event().expect("it counts");
    ctx.now += 100;
    write(&mut tc, &mut ctx, CCBUF, 2399);
    assert_eq!(tc.next_event(), Some(first));
    ctx.now = first;
    tc.advance(&mut ctx);
    tc.write(INTFLAG, Width::Byte, MC, &mut ctx);
    assert_eq!(tc.next_event(), Some(first + 2400));
    assert_eq!(tc.read(STATUS, Width::Byte, &mut ctx), 0);
}

#[test]
fn without_its_generic_clock_a_write_is_reported_and_never_done() {
    let (mut tc, mut ctx) = (Tc::new(4), Context::default());
    tc.write(CTRLA, Width::Word, ENABLE, &mut ctx);
    ctx.now += 1 << 50;
    assert_eq!(ctx.violations()[0].kind, Kind::Unclocked);
    assert_eq!(tc.read(SYNCBUSY, Width::Word, &mut ctx), 1 << SYNC_ENABLE);
}

#[test]
fn a_compare_value_is_not_written_while_the_last_one_is_crossing() {
    let (mut tc, mut ctx) = tc4();
    tc.write(CC, Width::Half, 10, &mut ctx);
    tc.write(CC, Width::Half, 20, &mut ctx);
    assert_eq!((ctx.violations()[0].kind, tc.cc[0]), (Kind::SyncBusy, 10));
}

#[test]
fn mode_and_waveform_cannot_be_changed_while_enabled() {
    let (mut tc, mut ctx) = matching(4799);
    write(&mut tc, &mut ctx, WAVE, 0);
    write(&mut tc, &mut ctx, CTRLA, ENABLE | 1 << 8);
    let kinds: Vec<_> = ctx.violations().iter().map(|violation| violation.kind).collect();
    assert_eq!(kinds, [Kind::EnableProtected; 2]);
    assert_eq!((tc.wave, tc.ctrla), (1, ENABLE));
}

#[test]
fn thirty_two_bits_need_the_bus_clock_of_the_timer_beside() {
    let (mut tc, mut ctx) = tc0();
    ctx.clocks.apb[2] = 1 << 12;
    write(&mut tc, &mut ctx, CTRLA, MODE_32 | ENABLE);
    assert!(matches!(ctx.violations()[0].kind, Kind::Misuse(_)));
    let (mut tc, mut ctx) = tc4();
    write(&mut tc, &mut ctx, CTRLA, MODE_32);
    assert_eq!(ctx.violations()[0].kind, Kind::ReservedValue);
}

#[test]
fn in_16_bit_mode_a_wide_compare_value_is_refused() {
    let (mut tc, mut ctx) = tc4();
    tc.write(CC, Width::Word, 10, &mut ctx);
    assert_eq!(ctx.violations()[0].kind, Kind::WrongWidth);
}

#[test]
fn a_software_reset_clears_everything_but_the_clock() {
    let (mut tc, mut ctx) = matching(4799);
    tc.write(CTRLA, Width::Word, SWRST, &mut ctx);
    assert_eq!((tc.cc, tc.ctrla, tc.next_event()), ([0; 2], 0, None));
    tc.write(INTENSET, Width::Byte, MC, &mut ctx);
    assert_eq!(ctx.violations()[0].kind, Kind::SyncBusy);
}
