//! Why the chip started (data sheet: "RSTC").

use sarah_protocol::telemetry::ResetCause;

use super::regs::system::Rcause;

pub use crate::board::boot::*;

/// The cause the reset controller gives.
pub fn reset_cause(flags: Rcause) -> ResetCause {
    if flags.por() {
        ResetCause::PowerOn
    } else if flags.bodcore() || flags.bodvdd() {
        ResetCause::BrownOut
    } else if flags.wdt() {
        ResetCause::Watchdog
    } else if flags.ext() {
        ResetCause::External
    } else if flags.syst() {
        ResetCause::Software
    } else {
        ResetCause::Unknown
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_up_outranks_what_else_is_set() {
        let flags = Rcause::ZERO.with_por(true).with_ext(true);
        assert_eq!(reset_cause(flags), ResetCause::PowerOn);
        assert_eq!(reset_cause(Rcause::ZERO.with_wdt(true)), ResetCause::Watchdog);
        assert_eq!(reset_cause(Rcause::ZERO), ResetCause::Unknown);
    }
}
