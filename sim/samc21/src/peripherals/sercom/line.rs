//! Transmit buffer, shifter and the two received characters of a SERCOM.

use std::collections::VecDeque;

use crate::time::Cycles;
use crate::wires::Serial;

/// Received characters that fit.
const DEPTH: usize = 2;

/// Characters on their way.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(super) struct Line {
    buffer: Option<u16>,
    /// The character in the shifter and when its last bit ends.
    shifter: Option<(u16, Cycles)>,
    received: VecDeque<u8>,
    last: u8,
    /// When the next character from outside is complete.
    arrival: Option<Cycles>,
}

impl Line {
    /// Room for a character to send.
    pub(super) fn has_room(&self) -> bool {
        self.buffer.is_none()
    }

    pub(super) fn has_received(&self) -> bool {
        !self.received.is_empty()
    }

    pub(super) fn is_sending(&self) -> bool {
        self.shifter.is_some()
    }

    /// Takes a character to send; an idle shifter starts on it.
    pub(super) fn put(&mut self, character: u16, ticks: u64, now: Cycles) {
        self.buffer = Some(character);
        if self.shifter.is_none() {
            self.shift_next(ticks, now);
        }
    }

    /// Moves the buffer's character, if there is one, into the empty shifter.
    pub(super) fn shift_next(&mut self, ticks: u64, from: Cycles) {
        self.shifter = self.buffer.take().map(|character| (character, from + ticks));
    }

    /// The character whose last bit has ended by `now`, and when.
    pub(super) fn shifted(&mut self, now: Cycles) -> Option<(u16, Cycles)> {
        let done = self.shifter.filter(|(_, at)| *at <= now)?;
        self.shifter = None;
        Some(done)
    }

    /// Keeps a received character; false if it is lost.
    pub(super) fn accept(&mut self, character: u8) -> bool {
        let fits = self.received.len() < DEPTH;
        if fits {
            self.received.push_back(character);
        }
        fits
    }

    /// The oldest received character; what was read last if there is none.
    pub(super) fn take(&mut self) -> u8 {
        self.last = self.received.pop_front().unwrap_or(self.last);
        self.last
    }

    /// Looks when the next character arrives.
    pub(super) fn listen(&mut self, serial: &Serial) {
        self.arrival = match serial {
            Serial::Uart(uart) => uart.to_chip.front().map(|byte| byte.at),
            _ => None,
        };
    }

    pub(super) fn next_event(&self) -> Option<Cycles> {
        [self.shifter.map(|(_, at)| at), self.arrival].into_iter().flatten().min()
    }
}
