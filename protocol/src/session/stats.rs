//! How good the link is.

/// Counters since the session began. All saturate.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct LinkStats {
    /// Good frames received.
    pub frames: u32,
    /// Frames with a broken check sum, stuffing or length.
    pub frame_errors: u32,
    /// Good frames that hold no message of ours.
    pub undecodable: u32,
    /// Frames missing by their sequence numbers.
    pub lost: u32,
    /// Requests sent again for want of an answer.
    pub retries: u32,
    /// Last round trip, µs.
    pub round_trip_us: u32,
    /// Worst round trip, µs.
    pub worst_round_trip_us: u32,
    last: Option<u16>,
}

impl LinkStats {
    /// A good frame with this number. Replies overtake telemetry in the robot, so a late one corrects the count.
    pub(super) fn received(&mut self, sequence: u16) {
        self.frames = self.frames.saturating_add(1);
        let Some(last) = self.last else {
            self.last = Some(sequence);
            return;
        };
        match sequence.wrapping_sub(last) {
            0 => {}
            ahead @ 1..0x8000 => {
                self.lost = self.lost.saturating_add(u32::from(ahead) - 1);
                self.last = Some(sequence);
            }
            _ => self.lost = self.lost.saturating_sub(1),
        }
    }

    /// The robot restarted and counts from the beginning.
    pub(super) fn restart(&mut self) {
        self.last = None;
    }

    pub(super) fn round_trip(&mut self, us: u64) {
        self.round_trip_us = u32::try_from(us).unwrap_or(u32::MAX);
        self.worst_round_trip_us = self.worst_round_trip_us.max(self.round_trip_us);
    }
}
