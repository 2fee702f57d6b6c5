//! A frame as bits on the wire, and how long they take (ISO 11898-1:2015, 10.4 "Frame format", 10.5 "Bit stuffing").
//!
//! Stuff bits depend on the contents, so the bits are built and counted. Of an FD frame only those up to the end of the
//! data are: stuff count and check sum have stuff bits at fixed places.

use crate::wires::{CanFrame, CanTiming};

/// Error flags and delimiters in nominal bits.
pub const FLAG: u64 = 6;
/// Recessive bits that end an error frame, and those that end a frame from the acknowledge delimiter on.
pub const DELIMITER: u64 = 8;
/// Recessive bits between frames.
pub const INTERMISSION: u64 = 3;
/// End of frame.
const EOF: u64 = 7;

/// Priority of a frame in arbitration: its bits up to the last on which senders may differ, left-aligned. The smallest
/// wins, since dominant is 0.
pub fn priority(frame: &CanFrame) -> u32 {
    // The bit after a base identifier is the remote bit; in its place an extended frame always sends recessive.
    let remote = u32::from(frame.remote && !frame.fd);
    match frame.extended {
        false => frame.id << 21 | remote << 20,
        true => frame.id >> 18 << 21 | 0b11 << 19 | (frame.id & 0x3_ffff) << 1 | remote,
    }
}

/// Code of a data length (DLC), the next one up for a length that has none.
pub fn length_code(length: u8) -> u32 {
    match length {
        0..=8 => length.into(),
        9..=12 => 9,
        13..=16 => 10,
        17..=20 => 11,
        21..=24 => 12,
        25..=32 => 13,
        33..=48 => 14,
        _ => 15,
    }
}

/// Number of bits of a frame by phase, stuff bits included, up to the check sum's last.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Shape {
    /// Before the bit rate switch bit; everything if there is no switch.
    pub slow: u64,
    /// After the bit rate switch bit.
    pub fast: u64,
    /// The bit rate switches.
    pub switches: bool,
}

/// Counts bits and inserts stuff bits.
struct Counter {
    last: bool,
    run: u32,
    bits: u64,
    /// Bits still enter the check sum of a classic frame.
    checked: bool,
    crc: u16,
}

impl Counter {
    fn push(&mut self, bit: bool) {
        // A stuff bit is due before the next bit, so that none is counted after the very last.
        if self.run == 5 {
            self.bits += 1;
            self.last = !self.last;
            self.run = 1;
        }
        self.run = if bit == self.last && self.bits != 0 { self.run + 1 } else { 1 };
        self.last = bit;
        self.bits += 1;
        if self.checked {
            let feedback = (self.crc >> 14 & 1 != 0) != bit;
            self.crc = self.crc << 1 & 0x7fff;
            if feedback {
                self.crc ^= 0x4599;
            }
        }
    }

    fn push_all(&mut self, value: u32, count: u32) {
        for index in (0..count).rev() {
            self.push(value >> index & 1 != 0);
        }
    }
}

impl Shape {
    /// The shape of a frame.
    pub fn of(frame: &CanFrame) -> Shape {
        let mut wire = Counter { last: true, run: 0, bits: 0, checked: true, crc: 0 };
        wire.push(false);
        if frame.extended {
            wire.push_all(frame.id >> 18, 11);
            wire.push_all(0b11, 2);
            wire.push_all(frame.id & 0x3_ffff, 18);
            wire.push(frame.remote && !frame.fd);
        } else {
            wire.push_all(frame.id, 11);
            wire.push(frame.remote && !frame.fd);
            wire.push(false);
        }
        let mut slow = None;
        if frame.fd {
            wire.push_all(0b10, 2);
            wire.push(frame.bit_rate_switch);
            if frame.bit_rate_switch {
                // A stuff bit before the switch bit is slow, too.
                slow = Some(wire.bits - 1);
            }
            wire.push(frame.error_state);
        } else {
            // The reserved bit; an extended frame has two.
            wire.push_all(0, if frame.extended { 2 } else { 1 });
        }
        wire.push_all(length_code(frame.length), 4);
        if !frame.remote || frame.fd {
            for byte in &frame.data[..usize::from(frame.length.min(64))] {
                wire.push_all((*byte).into(), 8);
            }
        }
        if frame.fd {
            // Stuff count (4 bits) and check sum, with a fixed stuff bit before every fourth bit.
            let check: u64 = 4 + if frame.length > 16 { 21 } else { 17 };
            wire.bits += check + check.div_ceil(4);
        } else {
            let crc = wire.crc;
            wire.checked = false;
            wire.push_all(crc.into(), 15);
            // The last bit of the check sum may need a stuff bit, too.
            wire.bits += u64::from(wire.run == 5);
        }
        match slow {
            Some(slow) => Shape { slow, fast: wire.bits - slow - 1, switches: true },
            None => Shape { slow: wire.bits, fast: 0, switches: false },
        }
    }

    /// Ticks from the start of the frame to the end of the check sum delimiter. The bit rate changes at the sample points
    /// of the switch bit and of that delimiter.
    pub fn to_delimiter(self, timing: &CanTiming) -> u64 {
        let [nominal, nominal_sample, data, data_sample] =
            [timing.nominal, timing.nominal_sample, timing.data, timing.data_sample].map(u64::from);
        if self.switches {
            let switch = nominal_sample + (data - data_sample);
            let delimiter = data_sample + (nominal - nominal_sample);
            self.slow * nominal + switch + self.fast * data + delimiter
        } else {
            (self.slow + 1) * nominal
        }
    }

    /// Ticks from the start of the frame to the end of the acknowledge slot.
    pub fn to_acknowledge(self, timing: &CanTiming) -> u64 {
        self.to_delimiter(timing) + u64::from(timing.nominal)
    }

    /// Ticks from the start of the frame to its end.
    pub fn to_end(self, timing: &CanTiming) -> u64 {
        self.to_acknowledge(timing) + (1 + EOF) * u64::from(timing.nominal)
    }

    /// Ticks to the switch of the bit rate, if there is one.
    pub fn to_switch(self, timing: &CanTiming) -> Option<u64> {
        self.switches.then(|| self.slow * u64::from(timing.nominal) + u64::from(timing.nominal_sample))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(id: u32, length: u8, fill: u8) -> CanFrame {
        let mut data = [0; 64];
        data[..length.into()].fill(fill);
        CanFrame {
            id,
            extended: false,
            fd: false,
            bit_rate_switch: false,
            error_state: false,
            remote: false,
            length,
            data,
        }
    }

    const TIMING: CanTiming = CanTiming { nominal: 48, nominal_sample: 38, data: 24, data_sample: 18 };

    #[test]
    fn a_classic_frame_without_stuffing_has_the_bits_of_the_standard() {
        // 1 + 11 + 1 + 1 + 1 + 4 + 64 + 15 + delimiter 1 + acknowledge 2 + end 7 = 108, plus stuff bits.
        let shape = Shape::of(&frame(0x555, 8, 0x55));
        let ticks = shape.to_end(&TIMING);
        let bits = ticks / 48;
        assert_eq!(ticks % 48, 0);
        assert!((108..=112).contains(&bits), "{bits}");
    }

    #[test]
    fn the_worst_classic_frame_has_at_most_the_known_number_of_stuff_bits() {
        // floor((34 + 8 s - 1) / 4) stuff bits for s bytes.
        for fill in 0..=255 {
            for id in [0, 0x078, 0x7ff, 0x3c1] {
                let bits = Shape::of(&frame(id, 8, fill)).slow;
                assert!((98..=98 + 24).contains(&bits), "{bits}");
            }
        }
        // Identifier 0: the start, 11 identifier bits, three more and the length code's first bit are equal.
        let zeros = Shape::of(&frame(0, 0, 0)).slow;
        assert!(zeros > 34, "{zeros}");
    }

    #[test]
    fn the_check_sum_of_a_known_frame_gives_its_known_stuffing() {
        // Bits of identifier 0x14, one byte 0x01, and their remainder by the polynomial, worked out by long division.
        let mut wire = Counter { last: true, run: 0, bits: 0, checked: true, crc: 0 };
        let mut bits = vec![false];
        let mut add = |value: u32, count: u32| bits.extend((0..count).rev().map(|i| value >> i & 1 != 0));
        add(0x14, 11);
        add(0, 3);
        add(1, 4);
        add(1, 8);
        bits.iter().for_each(|bit| wire.push(*bit));
        let mut remainder: Vec<bool> = bits.iter().copied().chain([false; 15]).collect();
        let polynomial: Vec<bool> = (0..16).rev().map(|i| 0xc599_u32 >> i & 1 != 0).collect();
        for at in 0..bits.len() {
            if remainder[at] {
                for (index, bit) in polynomial.iter().enumerate() {
                    remainder[at + index] ^= bit;
                }
            }
        }
        let by_division = remainder[bits.len()..].iter().fold(0_u16, |crc, bit| crc << 1 | u16::from(*bit));
        assert_eq!(wire.crc, by_division);
    }

    #[test]
    fn an_fd_frame_of_64_bytes_takes_the_bits_of_both_phases() {
        let mut long = frame(0x2aa, 64, 0x55);
        (long.fd, long.bit_rate_switch) = (true, true);
        let shape = Shape::of(&long);
        // Start, identifier, RRS, IDE, FDF, reserved: no run of five equal bits.
        assert_eq!(shape.slow, 1 + 11 + 2 + 2);
        // ESI, length code, data, stuff count and check sum with its fixed stuff bits; 0 1111 0 needs none, 1111 with the
        // data's first bits none either.
        assert_eq!(shape.fast, 1 + 4 + 512 + 25 + 7);
        let ticks = shape.to_end(&TIMING);
        assert_eq!(ticks, 16 * 48 + (38 + 6) + 549 * 24 + (18 + 10) + 9 * 48);
    }

    #[test]
    fn an_fd_frame_of_zeros_is_stuffed_after_every_five_bits() {
        let mut zeros = frame(0x2aa, 64, 0);
        (zeros.fd, zeros.bit_rate_switch) = (true, true);
        assert_eq!(Shape::of(&zeros).fast, 1 + 4 + 512 + 512 / 5 + 25 + 7);
    }

    #[test]
    fn the_lower_identifier_wins_then_data_over_remote_then_base_over_extended() {
        let low = frame(0x100, 0, 0);
        let high = frame(0x101, 0, 0);
        let remote = CanFrame { remote: true, ..low };
        let extended = CanFrame { extended: true, id: 0x100 << 18, ..low };
        let mut all = [high, extended, remote, low];
        all.sort_by_key(priority);
        assert_eq!(all, [low, remote, extended, high]);
    }
}
