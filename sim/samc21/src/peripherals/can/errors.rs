//! Error counters and the states they lead to (ISO 11898-1:2015, 12.1.4 "Fault confinement"; M_CAN User's Manual, ECR and
//! PSR).

use super::registers::flag;
use crate::wires::CanError;

/// No change since the last read of PSR.
const UNCHANGED: u32 = 7;
const WARNING: u16 = 96;
const PASSIVE: u16 = 128;
const BUS_OFF: u16 = 256;

/// Counters, states and last errors.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Errors {
    sent: u16,
    received: u16,
    logged: u8,
    last: u32,
    last_data: u32,
    bus_off: bool,
    /// RESI, RBRS, RFDF of frames received since the last read, in the place of PSR.
    last_frame: u32,
}

impl Default for Errors {
    fn default() -> Self {
        Errors { sent: 0, received: 0, logged: 0, last: UNCHANGED, last_data: UNCHANGED, bus_off: false, last_frame: 0 }
    }
}

impl Errors {
    /// ECR; reading it clears the error log counter.
    pub fn read_counters(&mut self) -> u32 {
        let logged = u32::from(std::mem::take(&mut self.logged));
        let passive = u32::from(self.received >= PASSIVE) << 15;
        u32::from(self.sent.min(255)) | u32::from(self.received.min(127)) << 8 | passive | logged << 16
    }

    /// PSR without activity and delay; reading it clears what happened last.
    pub fn read_status(&mut self) -> u32 {
        let state = [self.is_passive(), self.is_warning(), self.bus_off];
        let state = state.iter().enumerate().map(|(bit, on)| u32::from(*on) << (5 + bit)).sum::<u32>();
        let status = self.last | state | self.last_data << 8 | self.last_frame;
        (self.last, self.last_data, self.last_frame) = (UNCHANGED, UNCHANGED, 0);
        status
    }

    /// Error passive.
    pub fn is_passive(&self) -> bool {
        self.sent >= PASSIVE || self.received >= PASSIVE
    }

    fn is_warning(&self) -> bool {
        self.sent >= WARNING || self.received >= WARNING
    }

    /// Off the bus because of errors.
    pub fn is_bus_off(&self) -> bool {
        self.bus_off
    }

    /// A change of the counters; the interrupt flags of the states that changed.
    fn change(&mut self, change: impl FnOnce(&mut Self)) -> u32 {
        let before = (self.is_passive(), self.is_warning(), self.bus_off);
        change(self);
        self.bus_off |= self.sent >= BUS_OFF;
        let mut flags = 0;
        for (changed, flag) in [
            (before.0 != self.is_passive(), flag::EP),
            (before.1 != self.is_warning(), flag::EW),
            (before.2 != self.bus_off, flag::BO),
        ] {
            flags |= if changed { flag } else { 0 };
        }
        flags
    }

    /// A frame went out.
    pub fn sent(&mut self) -> u32 {
        self.last = 0;
        self.change(|errors| errors.sent = errors.sent.saturating_sub(1))
    }

    /// A frame came in.
    pub fn received(&mut self, fd: bool, bit_rate_switch: bool, error_state: bool) -> u32 {
        self.last = 0;
        if fd {
            self.last_data = 0;
            self.last_frame |= u32::from(error_state) << 11 | u32::from(bit_rate_switch) << 12 | 1 << 13;
        }
        // Above 127 the standard lets it fall to a value between 119 and 127.
        self.change(|errors| errors.received = errors.received.saturating_sub(1).min(PASSIVE - 1))
    }

    /// An error frame; the interrupt flags.
    pub fn error(&mut self, error: CanError, sending: bool, data_phase: bool, weight: u16) -> u32 {
        let last = if data_phase { &mut self.last_data } else { &mut self.last };
        *last = error as u32;
        let mut flags = if data_phase { flag::PED } else { flag::PEA };
        if weight == 0 {
            return flags;
        }
        if self.logged == u8::MAX {
            flags |= flag::ELO;
        }
        self.logged = self.logged.saturating_add(1);
        flags
            | self.change(|errors| match sending {
                true => errors.sent = (errors.sent + weight).min(BUS_OFF),
                false => errors.received = (errors.received + weight).min(PASSIVE),
            })
    }

    /// The recovery from bus-off is over; the interrupt flags.
    pub fn recovered(&mut self) -> u32 {
        // A dominant bit was expected in each sequence of recessive ones, so the last error is Bit0 (PSR.LEC).
        self.last = CanError::Bit0 as u32;
        self.change(|errors| (errors.sent, errors.received, errors.bus_off) = (0, 0, false))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thirty_two_failed_frames_lead_to_bus_off() {
        let mut errors = Errors::default();
        let states: Vec<u32> = (0..32).map(|_| errors.error(CanError::Bit0, true, false, 8)).collect();
        assert_eq!(states[11] & flag::EW, flag::EW);
        assert_eq!(states[15] & flag::EP, flag::EP);
        assert_eq!(states[31] & flag::BO, flag::BO);
        assert!(errors.is_bus_off());
        assert_eq!(states.iter().filter(|flags| **flags & flag::BO != 0).count(), 1);
        assert_eq!(errors.recovered() & flag::BO, flag::BO);
        assert_eq!(errors.read_counters() & 0xffff, 0);
    }

    #[test]
    fn a_lonely_sender_becomes_passive_but_never_leaves_the_bus() {
        let mut errors = Errors::default();
        for _ in 0..1000 {
            let weight = if errors.is_passive() { 0 } else { 8 };
            errors.error(CanError::Acknowledge, true, false, weight);
        }
        assert!(errors.is_passive() && !errors.is_bus_off());
        assert_eq!(errors.read_counters() & 0xff, 128);
    }

    #[test]
    fn reading_the_status_clears_the_last_errors() {
        let mut errors = Errors::default();
        errors.error(CanError::Crc, false, false, 1);
        errors.error(CanError::Form, false, true, 1);
        assert_eq!(errors.read_status() & 0x707, 6 | 2 << 8);
        assert_eq!(errors.read_status() & 0x707, 0x707);
        errors.received(true, true, false);
        assert_eq!(errors.read_status() & 0x7f07, 1 << 12 | 1 << 13);
    }
}
