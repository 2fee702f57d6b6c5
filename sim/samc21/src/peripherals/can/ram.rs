//! Message RAM: where elements lie and what is in them (M_CAN User's Manual, 2.4 "Message RAM").
//!
//! The chip has no memory of its own for messages: start addresses are offsets into the SRAM, which ends after half of
//! what they can name.

use super::registers::*;
use crate::context::Context;
use crate::sram::{self, Sram};
use crate::violation::Kind;
use crate::width::Width;
use crate::wires::CanFrame;

const T0_ESI: u32 = 1 << 31;
const T0_XTD: u32 = 1 << 30;
const T0_RTR: u32 = 1 << 29;
const T1_EFC: u32 = 1 << 23;
const FDF: u32 = 1 << 21;
const BRS: u32 = 1 << 20;
const R1_ANMF: u32 = 1 << 31;

/// What the sender pads with when the length code exceeds the element (2.4.3).
const PADDING: u8 = 0xcc;

/// Bytes for a length code of a classic or FD frame.
pub fn length(code: u32, fd: bool) -> u8 {
    const FD: [u8; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];
    let bytes = FD[code as usize & 15];
    if fd { bytes } else { bytes.min(8) }
}

/// Data bytes of an element by its size code (RXESC, TXESC).
pub fn element_bytes(code: u32) -> u32 {
    [8, 12, 16, 20, 24, 32, 48, 64][code as usize & 7]
}

/// Reads a word of message RAM at `offset`. Outside the SRAM that is the firmware's fault, and reads zero.
pub fn read(offset: u32, ctx: &mut Context) -> u32 {
    match place(offset) {
        Some(address) => ctx.sram.read(address, Width::Word),
        None => {
            ctx.report(Kind::Misuse("CAN message RAM outside the SRAM"));
            0
        }
    }
}

/// Writes a word of message RAM at `offset`.
pub fn write(offset: u32, value: u32, ctx: &mut Context) {
    match place(offset) {
        Some(address) => ctx.sram.write(address, Width::Word, value),
        None => ctx.report(Kind::Misuse("CAN message RAM outside the SRAM")),
    }
}

fn place(offset: u32) -> Option<u32> {
    let address = sram::BASE + (offset & !3);
    Sram::contains(address).then_some(address)
}

/// A transmit buffer as it lies in RAM.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Outgoing {
    /// The frame.
    pub frame: CanFrame,
    /// Store an event when it is sent.
    pub wants_event: bool,
    /// First two words of the event element, timestamp excepted.
    pub event: [u32; 2],
}

impl Outgoing {
    /// Reads transmit buffer `index`.
    pub fn read(index: u32, registers: &Registers, ctx: &mut Context) -> Outgoing {
        let room = element_bytes(registers.field(TXESC, 0, 3));
        let base = registers.field(TXBC, 0, 16) + index * (8 + room);
        let (t0, t1) = (read(base, ctx), read(base + 4, ctx));
        let extended = t0 & T0_XTD != 0;
        let fd = t1 & FDF != 0 && registers.cccr(CCCR_FDOE);
        let bit_rate_switch = fd && t1 & BRS != 0 && registers.cccr(CCCR_BRSE);
        let remote = t0 & T0_RTR != 0 && !fd;
        let length = length(t1 >> 16 & 15, fd);
        let mut data = [0; 64];
        if !remote {
            let held = usize::from(length).min(room as usize);
            for (index, word) in data[..held.next_multiple_of(4)].chunks_mut(4).enumerate() {
                word.copy_from_slice(&read(base + 8 + 4 * index as u32, ctx).to_le_bytes());
            }
            data[held..].fill(0);
            data[held..usize::from(length)].fill(PADDING);
        }
        let id = if extended { t0 & 0x1fff_ffff } else { t0 >> 18 & 0x7ff };
        let error_state = fd && t0 & T0_ESI != 0;
        // Event type 1: sent.
        let event = [t0, t1 & 0xff3f_0000 | 1 << 22];
        Outgoing {
            frame: CanFrame { id, extended, fd, bit_rate_switch, error_state, remote, length, data },
            wants_event: t1 & T1_EFC != 0,
            event,
        }
    }
}

/// How a received frame came through the filters.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Passed {
    /// Index of the filter; `None`: none matched.
    pub filter: Option<u8>,
    /// Time stamp.
    pub timestamp: u16,
}

/// Writes a received frame into an element of `room` data bytes at `base`.
pub fn store(frame: &CanFrame, passed: Passed, base: u32, room: u32, ctx: &mut Context) {
    let id = if frame.extended { frame.id | T0_XTD } else { frame.id << 18 };
    let flags = |bits: &[(bool, u32)]| bits.iter().filter(|(on, _)| *on).map(|(_, bit)| bit).sum::<u32>();
    let r0 = id | flags(&[(frame.error_state, T0_ESI), (frame.remote, T0_RTR)]);
    let r1 = flags(&[(frame.fd, FDF), (frame.bit_rate_switch, BRS), (passed.filter.is_none(), R1_ANMF)])
        | u32::from(passed.filter.unwrap_or(0)) << 24
        | crate::can_bus::bits::length_code(frame.length) << 16
        | u32::from(passed.timestamp);
    write(base, r0, ctx);
    write(base + 4, r1, ctx);
    let held = if frame.remote { 0 } else { usize::from(frame.length).min(room as usize) };
    for (index, word) in frame.data[..held.next_multiple_of(4)].chunks(4).enumerate() {
        let word = word.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte));
        write(base + 8 + 4 * index as u32, word, ctx);
    }
}
