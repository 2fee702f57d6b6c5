//! The watchdog through the HAL: 64 cycles of its 1.024 kHz clock, 62 ms, then the chip resets (data sheet: "WDT").

use atsamd_hal::pac;
use atsamd_hal::prelude::*;
use atsamd_hal::watchdog::WatchdogTimeout;

/// The armed watchdog; who holds it feeds it.
pub struct Watchdog(atsamd_hal::watchdog::Watchdog);

impl Watchdog {
    /// Starts it.
    pub fn start(wdt: pac::Wdt) -> Watchdog {
        let mut watchdog = atsamd_hal::watchdog::Watchdog::new(wdt);
        watchdog.start(WatchdogTimeout::Cycles64 as u8);
        Watchdog(watchdog)
    }

    /// Another 62 ms. Feeding again before the last feeding has reached its slow clock would do nothing, so it is left.
    pub fn feed(&mut self) {
        // SAFETY: the watchdog lies there and is only read.
        let wdt = unsafe { &*pac::Wdt::ptr() };
        if wdt.syncbusy().read().clear().bit_is_clear() {
            self.0.feed();
        }
    }
}
