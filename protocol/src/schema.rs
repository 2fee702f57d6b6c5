//! One number that tells whether two builds mean the same by the same bytes.
//!
//! It covers [`WIRE_DIGEST`], the check sum over the golden bytes of every message, and name, unit and limits of every
//! parameter. A test computes the digest anew: changing the wire breaks it, and writing the new digest here changes
//! the hash, so that old and new builds refuse each other by name.

use crate::frame::crc32;
use crate::params::{COUNT, SPECS};

/// CRC-32 over the golden bytes of the host messages, in the order of the golden test.
pub const WIRE_DIGEST: u32 = 0xad9e_9ef6;

const fn fold(hash: u32, bytes: &[u8]) -> u32 {
    // CRC over (previous hash ‖ CRC of the new part): compositional without a growing buffer.
    let [a, b, c, d] = hash.to_le_bytes();
    let [e, f, g, h] = crc32(bytes).to_le_bytes();
    crc32(&[a, b, c, d, e, f, g, h])
}

const HASH: u32 = {
    let mut hash = WIRE_DIGEST;
    let mut index = 0;
    while index < COUNT {
        let spec = &SPECS[index];
        hash = fold(hash, spec.symbol.as_bytes());
        hash = fold(hash, spec.unit.as_bytes());
        hash = fold(hash, &spec.min.to_le_bytes());
        hash = fold(hash, &spec.max.to_le_bytes());
        hash = fold(hash, &spec.max_change.to_le_bytes());
        index += 1;
    }
    hash
};

/// Hash of everything two builds must agree on.
pub const fn schema_hash() -> u32 {
    HASH
}
