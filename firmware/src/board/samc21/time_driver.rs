//! The clock of the slow tasks: TC0 with TC1 as one 32-bit counter at 1 MHz (data sheet: "TC").

use super::clocks::{self, Channel, Generator, TIME_BASE_HZ};
use super::regs::tc::*;
use super::vectors::{self, interrupt, priority};
use crate::board::time_driver::{Counter, TimeDriver};

const _: () = assert!(TIME_BASE_HZ / 16 == 1_000_000);

/// Marks the pair.
enum Tc0 {}

embassy_time_driver::time_driver_impl!(static DRIVER: TimeDriver<Tc0> = TimeDriver::new());

fn tc() -> MmioTc32<'static> {
    // SAFETY: TC0 lies there and is used by this module alone, in critical sections once its interrupt is on.
    unsafe { Tc32::new_mmio_at(TC0) }
}

impl Counter for Tc0 {
    /// READSYNC copies the counter to where it can be read.
    fn count() -> u32 {
        let mut tc = tc();
        tc.write_ctrlbset(CtrlB::ZERO.with_cmd(Cmd::ReadSync));
        while tc.read_syncbusy().ctrlb() {}
        while tc.read_ctrlbset().cmd() != Ok(Cmd::None) {}
        tc.read_count()
    }

    fn wrapped() -> bool {
        tc().read_intflag().ovf()
    }

    fn take_flags() -> bool {
        let mut tc = tc();
        let flags = tc.read_intflag();
        tc.write_intflag(flags);
        flags.ovf()
    }

    fn compare(at: u32) {
        let mut tc = tc();
        let _ = tc.write_cc(0, at);
        while tc.read_syncbusy().cc0() {}
        tc.write_intflag(Interrupts::ZERO.with_mc0(true));
        tc.write_intenset(Interrupts::ZERO.with_mc0(true));
    }

    fn no_compare() {
        tc().write_intenclr(Interrupts::ZERO.with_mc0(true));
    }
}

#[cortex_m_rt::interrupt]
fn TC0() {
    DRIVER.on_interrupt();
}

/// Starts the counter.
pub fn start() {
    clocks::open_apb(|apb| apb.with_tc0(true).with_tc1(true));
    clocks::feed(Channel::Tc0, Generator::TimeBase);
    let mut tc = tc();
    tc.write_ctrla(CtrlA::ZERO.with_swrst(true));
    while tc.read_syncbusy().swrst() {}
    let control = CtrlA::ZERO.with_mode(Mode::Count32).with_prescaler(Prescaler::Div16);
    tc.write_ctrla(control);
    tc.write_intenset(Interrupts::ZERO.with_ovf(true));
    tc.write_ctrla(control.with_enable(true));
    while tc.read_syncbusy().enable() {}
    vectors::enable(interrupt::TC0, priority::IO);
}
