//! The boot report of this chip.

use super::boot::{BootReport, ClockSource, reset_cause};
use super::regs::system::{RSTC, Rstc};

/// Reads and clears what the last life left behind. Call once, at start.
pub fn report(clock: ClockSource) -> BootReport {
    // SAFETY: the reset controller lies there and is only read.
    let flags = unsafe { Rstc::new_mmio_at(RSTC) }.read_rcause();
    // The crystal takes a different time to start each time; the counter has run meanwhile.
    crate::board::fault::report(reset_cause(flags), clock, cortex_m::peripheral::SYST::get_current())
}
