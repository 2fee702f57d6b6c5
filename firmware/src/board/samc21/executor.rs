//! The control task's executor: it runs in the interrupt line of a peripheral this firmware does not use, above all
//! slow tasks and below the tick.

use embassy_executor::{InterruptExecutor, SendSpawner};

use super::vectors::{interrupt, priority};

static CONTROL: InterruptExecutor = InterruptExecutor::new();

#[cortex_m_rt::interrupt]
fn PTC() {
    // SAFETY: called from its interrupt, which is enabled by `CONTROL.start`.
    unsafe { CONTROL.on_interrupt() }
}

/// Starts it. Call once.
pub fn start() -> SendSpawner {
    // SAFETY: before the executor starts; no critical section relies on this priority.
    unsafe { cortex_m::Peripherals::steal().NVIC.set_priority(interrupt::PTC, priority::CONTROL) };
    CONTROL.start(interrupt::PTC)
}
