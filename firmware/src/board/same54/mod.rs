//! ATSAME54P20A on a SAM E54 Xplained Pro: the coordinator's second home, on `atsamd-hal`.
//!
//! - `coordinator`: sets everything up through the HAL and starts the tasks of [`crate::board::coordinator`].
//! - `can`: CAN1 behind the board's transceiver. `uart`: the host link on the debugger's virtual COM port.
//! - `tick`, `time_driver`: the turns of the control task and the clock of the slow tasks. `nvm`: stored parameters.
//! - `watchdog`: over the HAL's.
//!
//! Registers come from the HAL's peripheral access crate; what the HAL does without waiting is left to it, and what it
//! would wait for (the flash) is done here. **Built, never run on silicon**; what no source at hand confirms is marked
//! UNVERIFIED. Pins are those of the board's user guide ("Extension Headers", "CAN", "Virtual COM Port", "LED").

pub mod can;
pub mod coordinator;
pub mod nvm;
pub mod tick;
pub mod time_driver;
pub mod uart;
pub mod watchdog;

use atsamd_hal::pac::{self, NVIC};
use cortex_m::interrupt::InterruptNumber;

/// CPU and buses, Hz.
pub const CPU_HZ: u32 = 120_000_000;
/// CAN and SERCOMs, Hz.
pub const FAST_HZ: u32 = 40_000_000;
/// Timers, Hz.
pub const TIMER_HZ: u32 = 8_000_000;

/// Who interrupts whom; the chip has eight levels, lower numbers win.
pub mod priority {
    /// Bytes of the host link: a few cycles each, and the chip holds only two of them.
    pub const BYTES: u8 = 0x00;
    /// The control tick's timer.
    pub const TICK: u8 = 0x20;
    /// The executor of the control task.
    pub const CONTROL: u8 = 0x40;
    /// Time driver and CAN: short handlers that wake slow tasks.
    pub const IO: u8 = 0x80;
}

/// Enables a line at a priority.
pub fn enable(line: impl InterruptNumber, priority: u8) {
    // SAFETY: called while setting up, before the handler's line can fire; no critical section relies on masking.
    unsafe {
        cortex_m::Peripherals::steal().NVIC.set_priority(line, priority);
        NVIC::unmask(line);
    }
}

/// The last act before a reset: CAN1 leaves the bus (data sheet: "CAN", CCCR.INIT). Nodes that hear no coordinator end
/// their cycle and brake.
pub fn fall_silent() {
    // SAFETY: the controller lies there; interrupts are off and nobody uses it any more.
    let can = unsafe { &*pac::Can1::ptr() };
    can.cccr().modify(|_, control| control.init().set_bit());
}
