//! The clock of the slow tasks: a 32-bit counter at 1 MHz, widened to 64 bits. Which counter, the board says.

use core::cell::{Cell, RefCell};
use core::marker::PhantomData;
use core::task::Waker;

use critical_section::{CriticalSection, Mutex};
use embassy_time_driver::Driver;
use embassy_time_queue_utils::Queue;

/// An alarm further away than this is approached in steps, so that its compare value is never ambiguous.
const STEP_US: u64 = 1 << 30;

/// A counter that runs freely, with one compare value. Used in critical sections only, once its interrupt is on.
pub trait Counter: Send + Sync + 'static {
    /// µs; wraps.
    fn count() -> u32;
    /// Whether it has wrapped since [`Counter::take_flags`].
    fn wrapped() -> bool;
    /// Takes what the interrupt was raised for: whether the counter wrapped.
    fn take_flags() -> bool;
    /// Raises the interrupt when the counter reaches `at`; forgets an earlier match.
    fn compare(at: u32);
    /// No more interrupt by comparison.
    fn no_compare();
}

/// The driver over a counter; the counter's interrupt calls [`TimeDriver::on_interrupt`].
pub struct TimeDriver<C> {
    high: Mutex<Cell<u32>>,
    queue: Mutex<RefCell<Queue>>,
    counter: PhantomData<C>,
}

impl<C: Counter> TimeDriver<C> {
    /// At 0.
    pub const fn new() -> TimeDriver<C> {
        TimeDriver {
            high: Mutex::new(Cell::new(0)),
            queue: Mutex::new(RefCell::new(Queue::new())),
            counter: PhantomData,
        }
    }

    fn now_in(&self, cs: CriticalSection) -> u64 {
        let low = C::count();
        // An overflow not yet handled counts only if the counter was read after it.
        let wrapped = C::wrapped() && low < 1 << 31;
        let high = self.high.borrow(cs).get().wrapping_add(wrapped.into());
        u64::from(high) << 32 | u64::from(low)
    }

    /// Whether the alarm is set; if not, it is due already.
    fn set_alarm(&self, cs: CriticalSection, at: u64) -> bool {
        if at == u64::MAX {
            C::no_compare();
            return true;
        }
        let now = self.now_in(cs);
        if at <= now {
            return false;
        }
        let next = at.min(now + STEP_US);
        C::compare(next as u32);
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

    /// To be called by the counter's interrupt.
    pub fn on_interrupt(&self) {
        critical_section::with(|cs| {
            if C::take_flags() {
                let high = self.high.borrow(cs);
                high.set(high.get().wrapping_add(1));
            }
            self.run_queue(cs);
        })
    }
}

impl<C: Counter> Default for TimeDriver<C> {
    fn default() -> Self {
        TimeDriver::new()
    }
}

impl<C: Counter> Driver for TimeDriver<C> {
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
