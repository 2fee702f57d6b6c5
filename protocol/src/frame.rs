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
    let mut raw: Vec<u8, MAX_RAW> = Vec::new();
    raw.push(header.version).ok()?;
    raw.extend_from_slice(&header.session.to_le_bytes()).ok()?;
    raw.extend_from_slice(&header.sequence.to_le_bytes()).ok()?;
    if body.len() > MAX_BODY {
        return None;
    }
    raw.extend_from_slice(body).ok()?;
    let check = CRC.checksum(&raw);
    raw.extend_from_slice(&check.to_le_bytes()).ok()?;
    let mut bytes = Bytes::new();
    bytes.resize(MAX_ENCODED, 0).ok()?;
    let stuffed = cobs::try_encode(&raw, bytes.get_mut(1..MAX_ENCODED - 1)?).ok()?;
    bytes.truncate(stuffed + 2);
    // The resize left a zero behind the stuffed bytes: the closing delimiter.
    Some(bytes)
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

fn open(stuffed: &mut [u8]) -> Result<Packet<'_>, FrameError> {
    let length = cobs::decode_in_place(stuffed).map_err(|_| FrameError::Stuffing)?;
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
