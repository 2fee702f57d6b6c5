//! The control tick: TC4 counts 48 MHz to the period (data sheet: "TC") and wakes the control task, or runs the handler
//! that [`Ticks::handle`] names: the difference is some hundred cycles of the executor's.
//!
//! Its interrupt preempts everything, control everything else; only a critical section delays them (the
//! longest copies one bus message, a few µs), and the next tick is on time again because the timer runs freely.

use core::future::poll_fn;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use core::task::Poll;

use cortex_m::peripheral::NVIC;
use embassy_sync::waitqueue::AtomicWaker;

use super::clocks::{self, CPU_HZ, Channel, Generator};
use super::regs::tc::*;
use super::vectors::{self, interrupt, priority};

/// Period of a node: 10 kHz.
pub const NODE_US: u32 = 100;
/// The longest period the 16-bit counter can make, µs.
pub const LONGEST_US: u32 = 0x1_0000 / (CPU_HZ / 1_000_000);

/// Ticks since start, wraps; written by the interrupt alone.
static RAISED: AtomicU32 = AtomicU32::new(0);
/// Ticks nobody was ready for, wraps; written by the control task alone.
static OVERRUNS: AtomicU32 = AtomicU32::new(0);
static WAKER: AtomicWaker = AtomicWaker::new();
/// Ticks go to [`HANDLER`]; set once.
static HANDLED: AtomicBool = AtomicBool::new(false);

/// The line whose handler may serve ticks: of a peripheral this firmware does not use.
pub const HANDLER: interrupt = interrupt::AC;

fn tc() -> MmioTc16<'static> {
    // SAFETY: TC4 lies there and is used by this module alone: set up once, afterwards by its interrupt.
    unsafe { Tc16::new_mmio_at(TC4) }
}

#[cortex_m_rt::interrupt]
fn TC4() {
    tc().write_intflag(Interrupts::ZERO.with_mc0(true));
    RAISED.store(RAISED.load(Ordering::Relaxed).wrapping_add(1), Ordering::Release);
    match HANDLED.load(Ordering::Relaxed) {
        true => NVIC::pend(HANDLER),
        false => WAKER.wake(),
    }
}

/// Ticks since the start; wraps.
pub fn raised() -> u32 {
    RAISED.load(Ordering::Acquire)
}

/// Ticks that came while the control task was still at work; wraps.
pub fn overruns() -> u32 {
    OVERRUNS.load(Ordering::Relaxed)
}

/// The control side's end of the tick.
pub struct Ticks {
    served: u32,
    period_us: u32,
}

impl Ticks {
    /// Starts the timer with a period of 1 to [`LONGEST_US`] µs. One task may wait for it.
    pub fn start(period_us: u32) -> Ticks {
        let period_us = period_us.clamp(1, LONGEST_US);
        clocks::open_apb(|apb| apb.with_tc4(true));
        clocks::feed(Channel::Tc4, Generator::Cpu);
        let mut tc = tc();
        tc.write_ctrla(CtrlA::ZERO.with_swrst(true));
        while tc.read_syncbusy().swrst() {}
        let control = CtrlA::ZERO.with_mode(Mode::Count16);
        tc.write_ctrla(control);
        tc.write_wave(Wave::ZERO.with_wavegen(Wavegen::Mfrq));
        let _ = tc.write_cc(0, (CPU_HZ / 1_000_000 * period_us - 1) as u16);
        while tc.read_syncbusy().cc0() {}
        tc.write_intenset(Interrupts::ZERO.with_mc0(true));
        tc.write_ctrla(control.with_enable(true));
        while tc.read_syncbusy().enable() {}
        vectors::enable(interrupt::TC4, priority::TICK);
        Ticks { served: raised(), period_us }
    }

    /// Waits for the next tick; the time since the last one served, µs: more than the period after an overrun.
    pub async fn next(&mut self) -> u32 {
        let passed = poll_fn(|context| {
            WAKER.register(context.waker());
            match raised().wrapping_sub(self.served) {
                0 => Poll::Pending,
                passed => Poll::Ready(passed),
            }
        })
        .await;
        self.serve(passed)
    }

    /// From now on each tick runs the handler of [`HANDLER`], which asks [`Ticks::passed`].
    pub fn handle(&self) {
        HANDLED.store(true, Ordering::Relaxed);
        vectors::enable(HANDLER, priority::CONTROL);
    }

    /// Time since the last tick served, µs; 0 if there was none.
    pub fn passed(&mut self) -> u32 {
        self.serve(raised().wrapping_sub(self.served))
    }

    fn serve(&mut self, passed: u32) -> u32 {
        self.served = self.served.wrapping_add(passed);
        if passed > 1 {
            let overruns = OVERRUNS.load(Ordering::Relaxed).wrapping_add(passed - 1);
            OVERRUNS.store(overruns, Ordering::Relaxed);
        }
        // Nearly always one: the chip calls a function to see whether a product overflows.
        if passed == 1 { self.period_us } else { passed.saturating_mul(self.period_us) }
    }
}
