//! The watchdog: 64 cycles of its own 1.024 kHz clock, 62 ms, then the chip resets and everything is braked
//! (data sheet: "WDT").

use super::regs::system::*;

fn wdt() -> MmioWdt<'static> {
    // SAFETY: the watchdog lies there; one task feeds it.
    unsafe { Wdt::new_mmio_at(WDT) }
}

/// The armed watchdog; who holds it feeds it.
pub struct Watchdog(());

impl Watchdog {
    /// Starts it.
    pub fn start() -> Watchdog {
        let mut wdt = wdt();
        wdt.write_config(WdtConfig::ZERO.with_per(Cycles::Cyc64));
        wdt.write_ctrla(WdtCtrlA::ZERO.with_enable(true));
        while wdt.read_syncbusy().enable() {}
        Watchdog(())
    }

    /// Another 62 ms. Feeding again before the last feeding has reached its slow clock would do nothing, so it is left.
    pub fn feed(&mut self) {
        let mut wdt = wdt();
        if !wdt.read_syncbusy().clear() {
            wdt.write_clear(WDT_KEY);
        }
    }
}
