//! The clock of the slow tasks: TC0 with TC1 as one 32-bit counter at 1 MHz, widened to 64 bits (data sheet: "TC").

use core::cell::{Cell, RefCell};
use core::task::Waker;

use critical_section::{CriticalSection, Mutex};
use embassy_time_driver::Driver;
use embassy_time_queue_utils::Queue;

use super::clocks::{self, Channel, Generator, TIME_BASE_HZ};
use super::regs::tc::*;
use super::vectors::{self, interrupt, priority};

const _: () = assert!(TIME_BASE_HZ / 16 == 1_000_000);

/// An alarm further away than this is approached in steps, so that its compare value is never ambiguous.
const STEP_US: u64 = 1 << 30;

struct TcDriver {
    high: Mutex<Cell<u32>>,
    queue: Mutex<RefCell<Queue>>,
}

embassy_time_driver::time_driver_impl!(static DRIVER: TcDriver = TcDriver {
    high: Mutex::new(Cell::new(0)),
    queue: Mutex::new(RefCell::new(Queue::new())),
});

fn tc() -> MmioTc32<'static> {
    // SAFETY: TC0 lies there and is used by this module alone, in critical sections once its interrupt is on.
    unsafe { Tc32::new_mmio_at(TC0) }
}

/// The counter: READSYNC copies it to where it can be read.
fn count(tc: &mut MmioTc32<'static>) -> u32 {
    tc.write_ctrlbset(CtrlB::ZERO.with_cmd(Cmd::ReadSync));
    while tc.read_syncbusy().ctrlb() {}
    while tc.read_ctrlbset().cmd() != Ok(Cmd::None) {}
    tc.read_count()
}

impl TcDriver {
    fn now_in(&self, cs: CriticalSection) -> u64 {
        let mut tc = tc();
        let low = count(&mut tc);
        // An overflow not yet handled counts only if the counter was read after it.
        let wrapped = tc.read_intflag().ovf() && low < 1 << 31;
        let high = self.high.borrow(cs).get().wrapping_add(wrapped.into());
        u64::from(high) << 32 | u64::from(low)
    }

    /// Whether the alarm is set; if not, it is due already.
    fn set_alarm(&self, cs: CriticalSection, at: u64) -> bool {
        let mut tc = tc();
        if at == u64::MAX {
            tc.write_intenclr(Interrupts::ZERO.with_mc0(true));
            return true;
        }
        let now = self.now_in(cs);
        if at <= now {
            return false;
        }
        let next = at.min(now + STEP_US);
        let _ = tc.write_cc(0, next as u32);
        while tc.read_syncbusy().cc0() {}
        tc.write_intflag(Interrupts::ZERO.with_mc0(true));
        tc.write_intenset(Interrupts::ZERO.with_mc0(true));
        // The match may have passed while it was being set.
        self.now_in(cs) < next
    }

    fn run_queue(&self, cs: CriticalSection) {
        let mut queue = self.queue.borrow(cs).borrow_mut();
        let mut next = queue.next_expiration(self.now_in(cs));
        while !self.set_alarm(cs, next) {
            next = queue.next_expiration(self.now_in(cs));
        }
    }
}

impl Driver for TcDriver {
    fn now(&self) -> u64 {
        critical_section::with(|cs| self.now_in(cs))
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        critical_section::with(|cs| {
            if self.queue.borrow(cs).borrow_mut().schedule_wake(at, waker) {
                self.run_queue(cs);
            }
        })
    }
}

#[cortex_m_rt::interrupt]
fn TC0() {
    critical_section::with(|cs| {
        let mut tc = tc();
        let flags = tc.read_intflag();
        tc.write_intflag(flags);
        if flags.ovf() {
            let high = DRIVER.high.borrow(cs);
            high.set(high.get().wrapping_add(1));
        }
        DRIVER.run_queue(cs);
    })
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
