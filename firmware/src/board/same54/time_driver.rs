//! The clock of the slow tasks: TC0 with TC1 as one 32-bit counter at 1 MHz (data sheet: "TC"). The HAL offers 16 bits
//! only, so the registers are set here; the clock comes from it.

use atsamd_hal::clock::v2::pclk::{Pclk, PclkSourceId};
use atsamd_hal::clock::v2::types::Tc0Tc1;
use atsamd_hal::pac::{self, Interrupt, Mclk, interrupt};

use super::{TIMER_HZ, enable, priority};
use crate::board::time_driver::{Counter, TimeDriver};

const _: () = assert!(TIMER_HZ / 8 == 1_000_000);

/// Marks the pair.
enum Pair {}

embassy_time_driver::time_driver_impl!(static DRIVER: TimeDriver<Pair> = TimeDriver::new());

fn tc() -> &'static pac::tc0::Count32 {
    // SAFETY: TC0 lies there and is used by this module alone, in critical sections once its interrupt is on.
    unsafe { &*pac::Tc0::ptr() }.count32()
}

impl Counter for Pair {
    /// READSYNC copies the counter to where it can be read; 0.75 µs.
    fn count() -> u32 {
        let tc = tc();
        tc.ctrlbset().write(|control| control.cmd().readsync());
        while tc.syncbusy().read().ctrlb().bit_is_set() {}
        while !tc.ctrlbset().read().cmd().is_none() {}
        tc.count().read().bits()
    }

    fn wrapped() -> bool {
        tc().intflag().read().ovf().bit_is_set()
    }

    fn take_flags() -> bool {
        let flags = tc().intflag().read();
        // SAFETY: any value is allowed; ones clear.
        tc().intflag().write(|clear| unsafe { clear.bits(flags.bits()) });
        flags.ovf().bit_is_set()
    }

    fn compare(at: u32) {
        let tc = tc();
        // SAFETY: any value is allowed.
        tc.cc(0).write(|compare| unsafe { compare.bits(at) });
        while tc.syncbusy().read().cc0().bit_is_set() {}
        tc.intflag().write(|clear| clear.mc0().set_bit());
        tc.intenset().write(|on| on.mc0().set_bit());
    }

    fn no_compare() {
        tc().intenclr().write(|off| off.mc0().set_bit());
    }
}

#[interrupt]
fn TC0() {
    DRIVER.on_interrupt();
}

/// Starts the counter; it is fed by `clock` for ever.
pub fn start<I: PclkSourceId>(clock: Pclk<Tc0Tc1, I>, mclk: &Mclk, _tc0: pac::Tc0, _tc1: pac::Tc1) {
    // Never disabled again: that would take the token back.
    let _ = clock;
    mclk.apbamask().modify(|_, mask| mask.tc0_().set_bit().tc1_().set_bit());
    let tc = tc();
    tc.ctrla().write(|control| control.swrst().set_bit());
    while tc.syncbusy().read().swrst().bit_is_set() {}
    tc.ctrla().write(|control| control.mode().count32().prescaler().div8());
    tc.intenset().write(|on| on.ovf().set_bit());
    tc.ctrla().modify(|_, control| control.enable().set_bit());
    while tc.syncbusy().read().enable().bit_is_set() {}
    enable(Interrupt::TC0, priority::IO);
}
