//! The turns: TC4 through the HAL, 8 MHz to 1 kHz (data sheet: "TC").

use core::future::poll_fn;
use core::sync::atomic::{AtomicU32, Ordering};
use core::task::Poll;

use atsamd_hal::fugit::ExtU32;
use atsamd_hal::pac::{self, Interrupt, interrupt};
use atsamd_hal::timer::TimerCounter4;
use atsamd_hal::timer_traits::InterruptDrivenTimer;
use embassy_sync::waitqueue::AtomicWaker;

use super::{TIMER_HZ, enable, priority};
use crate::board::coordinator::{PERIOD_US, Turns};

/// Turns since start, wraps; written by the interrupt alone.
static RAISED: AtomicU32 = AtomicU32::new(0);
/// Turns nobody was ready for, wraps; written by the control task alone.
static LATE: AtomicU32 = AtomicU32::new(0);
static WAKER: AtomicWaker = AtomicWaker::new();

#[interrupt]
fn TC4() {
    // SAFETY: TC4 lies there; its flags are written by this interrupt alone.
    let tc = unsafe { &*pac::Tc4::ptr() };
    tc.count16().intflag().write(|flags| flags.ovf().set_bit());
    RAISED.store(RAISED.load(Ordering::Relaxed).wrapping_add(1), Ordering::Release);
    WAKER.wake();
}

/// Turns since the start, and those that came while the control task was still at work; both wrap.
pub fn counts() -> (u32, u32) {
    (RAISED.load(Ordering::Acquire), LATE.load(Ordering::Relaxed))
}

/// The control side's end.
pub struct Ticks {
    _timer: TimerCounter4,
    served: u32,
}

/// The HAL counts one clock period more than asked for.
const ASKED_NS: u32 = PERIOD_US * 1_000 - 1_000_000_000 / TIMER_HZ;
const _: () = assert!(ASKED_NS as u64 * TIMER_HZ as u64 == 1_000 * (PERIOD_US as u64 * TIMER_HZ as u64 - 1_000_000));

impl Ticks {
    /// Starts the timer. One task may wait for it.
    pub fn start(mut timer: TimerCounter4) -> Ticks {
        timer.start(ASKED_NS.nanos());
        timer.enable_interrupt();
        enable(Interrupt::TC4, priority::TICK);
        Ticks { _timer: timer, served: counts().0 }
    }
}

impl Turns for Ticks {
    async fn next(&mut self) {
        let passed = poll_fn(|context| {
            WAKER.register(context.waker());
            match counts().0.wrapping_sub(self.served) {
                0 => Poll::Pending,
                passed => Poll::Ready(passed),
            }
        })
        .await;
        self.served = self.served.wrapping_add(passed);
        LATE.store(counts().1.wrapping_add(passed - 1), Ordering::Relaxed);
    }
}
