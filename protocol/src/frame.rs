//! Serial frames: a header and a body, checked as a whole before anything in them is looked at.
//!
//! ```text
//!   00 │ COBS( version u8 │ session u16 │ sequence u16 │ body 0…192 bytes │ CRC-32 u32 ) │ 00
//!       └──────────────────── covered by the CRC ─────────────────────────┘
//! ```
//!
//! All integers little-endian. COBS leaves no zero byte between the delimiters, so a receiver finds the next frame
//! after any garbage; the leading zero lets a frame survive the half frame before it. CRC-32/ISO-HDLC (the one of
//! Ethernet and zip) covers header and body. `version` 0 marks the frozen messages of [`crate::host`].

use crc::{CRC_32_ISO_HDLC, Crc, NoTable, Table};
use heapless::Vec;

/// Longest body in bytes.
pub const MAX_BODY: usize = 192;
/// Header in bytes.
pub const HEADER: usize = 5;
const CHECK: usize = 4;
/// Longest frame before COBS in bytes.
pub const MAX_RAW: usize = HEADER + MAX_BODY + CHECK;
/// Longest frame after COBS in bytes, both delimiters included. Below 254 bytes COBS adds exactly one.
pub const MAX_ENCODED: usize = MAX_RAW + 3;

/// An encoded frame, delimiters included: what goes down the wire.
pub type Bytes = Vec<u8, MAX_ENCODED>;

// A table of 1 KiB; a kilobyte of flash for a quarter of the time.
static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// CRC-32/ISO-HDLC at compile time.
pub(crate) const fn crc32(bytes: &[u8]) -> u32 {
    Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC).checksum(bytes)
}

/// CRC-32/ISO-HDLC at run time, sharing the frames' table.
pub fn checksum(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

/// What every frame says first.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Header {
    /// Protocol version of the body; 0 for the frozen messages.
    pub version: u8,
    /// The host session that speaks or is spoken to; 0 addresses every host.
    pub session: u16,
    /// Message number; wraps. A gap tells lost frames, a reply names the request's.
    pub sequence: u16,
}

/// A frame whose check sum was right.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Packet<'a> {
    /// Version, session, sequence.
    pub header: Header,
    /// The undecoded body.
    pub body: &'a [u8],
}

/// Why the bytes between two delimiters are not a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum FrameError {
    /// More bytes than any frame has.
    #[error("frame longer than {MAX_RAW} bytes")]
    TooLong,
    /// Fewer bytes than header and check sum.
    #[error("frame shorter than header and check sum")]
    TooShort,
    /// The stuffing is broken.
    #[error("broken COBS stuffing")]
    Stuffing,
    /// The check sum is wrong.
    #[error("CRC-32 mismatch")]
    Crc,
}

/// One frame with its delimiters. `None` if `body` is longer than [`MAX_BODY`].
pub fn encode(header: Header, body: &[u8]) -> Option<Bytes> {
    if body.len() > MAX_BODY {
        return None;
    }
    // The opening delimiter, and a zero for the first distance.
    let mut bytes = Bytes::from_array([0, 0]);
    bytes.push(header.version).ok()?;
    bytes.extend_from_slice(&header.session.to_le_bytes()).ok()?;
    bytes.extend_from_slice(&header.sequence.to_le_bytes()).ok()?;
    bytes.extend_from_slice(body).ok()?;
    let check = CRC.checksum(bytes.get(2..)?);
    bytes.extend_from_slice(&check.to_le_bytes()).ok()?;
    stuff(bytes.get_mut(1..)?);
    bytes.push(0).ok()?;
    Some(bytes)
}

// One block suffices: no distance exceeds 254.
const _: () = assert!(MAX_RAW < 254);

/// COBS in place: every zero, the first byte's included, becomes the distance to the next one.
fn stuff(bytes: &mut [u8]) {
    let mut distance = 1_u8;
    for byte in bytes.iter_mut().rev() {
        if *byte == 0 {
            *byte = distance;
            distance = 0;
        }
        distance = distance.wrapping_add(1);
    }
}

/// Finds frames in a stream of bytes. `N` bounds the stuffed length; [`MAX_ENCODED`] takes every frame.
///
/// Total: whatever arrives, each byte costs bounded time and the next delimiter starts afresh.
#[derive(Clone, Debug, Default)]
pub struct Deframer<const N: usize = MAX_ENCODED> {
    buffer: Vec<u8, N>,
    overlong: bool,
    /// The buffer's frame was handed out: the next byte starts a new one.
    spent: bool,
}

impl<const N: usize> Deframer<N> {
    /// Empty, waiting for the first frame.
    pub const fn new() -> Self {
        Deframer { buffer: Vec::new(), overlong: false, spent: false }
    }

    /// Takes one byte; at a delimiter says what the bytes before it were. Empty frames (two delimiters) are silent.
    pub fn push(&mut self, byte: u8) -> Option<Result<Packet<'_>, FrameError>> {
        if self.spent {
            self.buffer.clear();
            self.overlong = false;
            self.spent = false;
        }
        if byte != 0 {
            self.overlong |= self.buffer.push(byte).is_err();
            return None;
        }
        self.spent = true;
        if self.overlong {
            return Some(Err(FrameError::TooLong));
        }
        if self.buffer.is_empty() {
            return None;
        }
        Some(open(&mut self.buffer))
    }
}

/// Undoes COBS in place; the length of the result. Without an index that the compiler would have to check: this runs
/// where nothing may panic.
fn unstuff(bytes: &mut [u8]) -> Option<usize> {
    let (mut read, mut write) = (0, 0);
    while let Some(code) = bytes.get(read).copied() {
        read += 1;
        for _ in 1..code {
            let byte = *bytes.get(read)?;
            *bytes.get_mut(write)? = byte;
            (read, write) = (read + 1, write + 1);
        }
        match code {
            0 => return None,
            // A full block, or the last one, stands for no zero.
            0xff => {}
            _ if read == bytes.len() => {}
            _ => {
                *bytes.get_mut(write)? = 0;
                write += 1;
            }
        }
    }
    Some(write)
}

fn open(stuffed: &mut [u8]) -> Result<Packet<'_>, FrameError> {
    let length = unstuff(stuffed).ok_or(FrameError::Stuffing)?;
    let raw = stuffed.get(..length).ok_or(FrameError::Stuffing)?;
    if raw.len() > MAX_RAW {
        return Err(FrameError::TooLong);
    }
    let (covered, check) = raw.split_last_chunk::<CHECK>().ok_or(FrameError::TooShort)?;
    let (header, body) = covered.split_first_chunk::<HEADER>().ok_or(FrameError::TooShort)?;
    if CRC.checksum(covered) != u32::from_le_bytes(*check) {
        return Err(FrameError::Crc);
    }
    let [version, s0, s1, q0, q1] = *header;
    let header = Header { version, session: u16::from_le_bytes([s0, s1]), sequence: u16::from_le_bytes([q0, q1]) };
    Ok(Packet { header, body })
}

#[cfg(test)]
mod tests {
    use super::{MAX_RAW, stuff, unstuff};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn stuffing_agrees_with_the_crate_for_it(raw in prop::collection::vec(prop_oneof![Just(0), any::<u8>()], 0..=MAX_RAW)) {
            let mut stuffed = [&[0][..], &raw].concat();
            stuff(&mut stuffed);
            prop_assert_eq!(stuffed, cobs::encode_vec(&raw));
        }

        #[test]
        fn unstuffing_agrees_with_the_crate_for_it(raw in prop::collection::vec(any::<u8>(), 0..600)) {
            let mut stuffed = cobs::encode_vec(&raw);
            let length = unstuff(&mut stuffed);
            prop_assert_eq!(length.map(|length| &stuffed[..length]), Some(&raw[..]));
        }

        #[test]
        fn unstuffing_is_total(mut bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let length = unstuff(&mut bytes);
            prop_assert!(length.is_none_or(|length| length <= bytes.len()));
        }
    }
}
