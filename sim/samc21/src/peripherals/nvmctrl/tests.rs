use super::*;

const RWWEEER: u32 = 0x1a;
const RWWEEWP: u32 = 0x1c;

fn nvmctrl() -> (Nvmctrl, Context) {
    (Nvmctrl::default(), Context::default())
}

fn command(nvm: &mut Nvmctrl, ctx: &mut Context, command: u32, address: u32) {
    nvm.write(ADDR, Width::Word, address / 2, ctx);
    nvm.write(CTRLA, Width::Half, KEY << 8 | command, ctx);
}

fn fill(nvm: &mut Nvmctrl, ctx: &mut Context, address: u32, word: u32) {
    for at in (0..PAGE).step_by(4) {
        nvm.store(address + at, Width::Word, word, ctx);
    }
}

fn wait(nvm: &mut Nvmctrl, ctx: &mut Context) -> u64 {
    let before = ctx.now;
    ctx.now = nvm.next_event().expect("it is busy");
    nvm.advance(ctx);
    ctx.now - before
}

#[test]
fn a_page_of_rwwee_is_programmed_while_the_program_runs_on() {
    let (mut nvm, mut ctx) = nvmctrl();
    fill(&mut nvm, &mut ctx, RWWEE_BASE + 64, 0x1234_5678);
    assert_eq!(nvm.read(STATUS, Width::Half, &mut ctx), STATUS_LOAD);
    command(&mut nvm, &mut ctx, RWWEEWP, RWWEE_BASE + 64);
    assert_eq!(ctx.now, Cycles(0));
    assert_eq!(nvm.read(INTFLAG, Width::Byte, &mut ctx), 0);
    assert_eq!(ctx.nvm.read(RWWEE_BASE + 64, Width::Word), Some(!0));
    assert_eq!(wait(&mut nvm, &mut ctx), Cycles::from_micros(PAGE_MICROS).0);
    assert_eq!(nvm.read(INTFLAG, Width::Byte, &mut ctx), READY);
    assert_eq!(ctx.nvm.read(RWWEE_BASE + 124, Width::Word), Some(0x1234_5678));
    assert_eq!(ctx.nvm.read(RWWEE_BASE + 128, Width::Word), Some(!0));
    assert_eq!(ctx.violations(), []);
}

#[test]
fn a_row_is_four_pages() {
    let (mut nvm, mut ctx) = nvmctrl();
    ctx.nvm.load(RWWEE_BASE + 256 - 4, &[0; 256 + 8]);
    command(&mut nvm, &mut ctx, RWWEEER, RWWEE_BASE + 300);
    assert_eq!(wait(&mut nvm, &mut ctx), Cycles::from_micros(ROW_MICROS).0);
    let words = [252, 256, 508, 512].map(|at| ctx.nvm.read(RWWEE_BASE + at, Width::Word));
    assert_eq!(words, [Some(0), Some(!0), Some(!0), Some(0)]);
}

#[test]
fn the_main_array_holds_the_cpu_while_it_is_worked_on() {
    let (mut nvm, mut ctx) = nvmctrl();
    command(&mut nvm, &mut ctx, 0x02, 0x1_0000);
    assert_eq!(ctx.now, Cycles::from_micros(ROW_MICROS));
}

#[test]
fn a_wrong_key_is_a_programming_error() {
    let (mut nvm, mut ctx) = nvmctrl();
    nvm.write(CTRLA, Width::Half, 0x5a02, &mut ctx);
    assert_eq!(nvm.read(STATUS, Width::Half, &mut ctx), STATUS_PROGE);
    assert_eq!(nvm.read(INTFLAG, Width::Byte, &mut ctx), READY | ERROR);
    assert_eq!(ctx.violations()[0].kind, Kind::WriteProtected);
    nvm.write(STATUS, Width::Half, STATUS_PROGE, &mut ctx);
    assert_eq!(nvm.read(STATUS, Width::Half, &mut ctx), 0);
}

#[test]
fn a_command_while_busy_is_a_programming_error() {
    let (mut nvm, mut ctx) = nvmctrl();
    command(&mut nvm, &mut ctx, RWWEEER, RWWEE_BASE);
    command(&mut nvm, &mut ctx, RWWEEER, RWWEE_BASE + 256);
    assert_eq!(nvm.read(STATUS, Width::Half, &mut ctx), STATUS_PROGE);
    assert!(matches!(ctx.violations()[0].kind, Kind::Misuse(_)));
}

#[test]
fn a_command_for_another_section_is_a_programming_error() {
    let (mut nvm, mut ctx) = nvmctrl();
    command(&mut nvm, &mut ctx, RWWEEER, 0x1000);
    assert!(!nvm.is_busy());
    assert!(matches!(ctx.violations()[0].kind, Kind::Misuse(_)));
}

#[test]
fn programming_what_was_not_erased_is_reported() {
    let (mut nvm, mut ctx) = nvmctrl();
    ctx.nvm.load(RWWEE_BASE, &[0; 4]);
    nvm.store(RWWEE_BASE, Width::Word, 0x55, &mut ctx);
    command(&mut nvm, &mut ctx, RWWEEWP, RWWEE_BASE);
    assert!(matches!(ctx.violations()[0].kind, Kind::Misuse(_)));
}

#[test]
fn a_byte_store_into_the_page_buffer_faults() {
    let (mut nvm, mut ctx) = nvmctrl();
    nvm.store(RWWEE_BASE, Width::Byte, 1, &mut ctx);
    assert!(ctx.bus_error);
    assert_eq!(ctx.violations()[0].kind, Kind::WrongWidth);
}

#[test]
fn without_manual_write_filling_the_page_programs_it() {
    let (mut nvm, mut ctx) = nvmctrl();
    nvm.write(CTRLB, Width::Word, 0, &mut ctx);
    fill(&mut nvm, &mut ctx, RWWEE_BASE, 7);
    wait(&mut nvm, &mut ctx);
    assert_eq!(ctx.nvm.read(RWWEE_BASE + 60, Width::Word), Some(7));
}

#[test]
fn a_power_cut_leaves_a_torn_page() {
    let (mut nvm, mut ctx) = nvmctrl();
    fill(&mut nvm, &mut ctx, RWWEE_BASE, 0);
    command(&mut nvm, &mut ctx, RWWEEWP, RWWEE_BASE);
    ctx.now += Cycles::from_micros(PAGE_MICROS / 2).0;
    nvm.reset(Reset::PowerOn, &mut ctx);
    let bytes = [31, 32, 33].map(|at| ctx.nvm.read(RWWEE_BASE + at, Width::Byte));
    assert_eq!(bytes, [Some(0), Some(0xa5), Some(0xff)]);
    assert!(!nvm.is_busy());
}

#[test]
fn a_power_cut_leaves_a_torn_row() {
    let (mut nvm, mut ctx) = nvmctrl();
    ctx.nvm.load(RWWEE_BASE, &[0; 256]);
    command(&mut nvm, &mut ctx, RWWEEER, RWWEE_BASE);
    ctx.now += Cycles::from_micros(ROW_MICROS / 2).0;
    nvm.reset(Reset::BrownOutSupply, &mut ctx);
    let bytes = [127, 128, 129].map(|at| ctx.nvm.read(RWWEE_BASE + at, Width::Byte));
    assert_eq!(bytes, [Some(0xff), Some(0xa5), Some(0)]);
}

#[test]
fn too_few_wait_states_for_the_clock_are_reported() {
    let (mut nvm, mut ctx) = nvmctrl();
    ctx.clocks.main = Hertz(48_000_000);
    nvm.write(CTRLB, Width::Word, MANW | 2 << 1, &mut ctx);
    assert_eq!(ctx.violations(), []);
    nvm.write(CTRLB, Width::Word, MANW | 1 << 1, &mut ctx);
    assert!(matches!(ctx.violations()[0].kind, Kind::Misuse(_)));
}
