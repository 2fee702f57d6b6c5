//! Acceptance filtering (M_CAN User's Manual, 3.4.1 "Acceptance Filtering").
//!
//! Elements are tried in order; the first that matches decides.

use super::ram;
use super::registers::*;
use crate::context::Context;
use crate::wires::CanFrame;

/// Where a frame goes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Target {
    /// Nowhere.
    Reject,
    /// FIFO 0 or 1.
    Fifo(usize),
    /// A dedicated buffer.
    Buffer(u8),
    /// Nowhere, but its arrival is told as a high-priority message.
    Tell,
}

/// What the filters decided.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Verdict {
    /// Where the frame goes.
    pub target: Target,
    /// Index of the element that matched.
    pub filter: Option<u8>,
    /// It is a high-priority message.
    pub priority: bool,
}

impl Verdict {
    fn of(code: u32, filter: u8) -> Verdict {
        let target = match code {
            1 | 5 => Target::Fifo(0),
            2 | 6 => Target::Fifo(1),
            4 => Target::Tell,
            _ => Target::Reject,
        };
        Verdict { target, filter: Some(filter), priority: (4..=6).contains(&code) }
    }
}

/// How an element compares.
enum Test {
    Range(u32, u32),
    Dual(u32, u32),
    Classic(u32, u32),
    Never,
}

impl Test {
    fn passes(&self, id: u32) -> bool {
        match *self {
            Test::Range(low, high) => (low..=high).contains(&id),
            Test::Dual(one, other) => id == one || id == other,
            Test::Classic(id_wanted, mask) => id & mask == id_wanted & mask,
            Test::Never => false,
        }
    }
}

/// Sends a frame through the filters. `occupied`: dedicated buffers that still hold an unread message; they match nothing.
pub fn judge(frame: &CanFrame, registers: &Registers, occupied: u64, ctx: &mut Context) -> Verdict {
    let (reject_remote, not_matching) = match frame.extended {
        false => (registers.field(GFC, 1, 1), registers.field(GFC, 4, 2)),
        true => (registers.field(GFC, 0, 1), registers.field(GFC, 2, 2)),
    };
    let rejected = Verdict { target: Target::Reject, filter: None, priority: false };
    if frame.remote && reject_remote != 0 {
        return rejected;
    }
    let matched = match frame.extended {
        false => standard(frame.id, registers, occupied, ctx),
        true => extended(frame.id, registers, occupied, ctx),
    };
    matched.unwrap_or(match not_matching {
        0 => Verdict { target: Target::Fifo(0), ..rejected },
        1 => Verdict { target: Target::Fifo(1), ..rejected },
        _ => rejected,
    })
}

fn standard(id: u32, registers: &Registers, occupied: u64, ctx: &mut Context) -> Option<Verdict> {
    let base = registers.field(SIDFC, 0, 16);
    for index in 0..registers.field(SIDFC, 16, 8).min(128) {
        let element = ram::read(base + 4 * index, ctx);
        let (code, one, two) = (element >> 27 & 7, element >> 16 & 0x7ff, element & 0x7ff);
        if code == 7 {
            if let Some(verdict) = buffer(id == one, two, index as u8, occupied) {
                return Some(verdict);
            }
            continue;
        }
        let test = match element >> 30 {
            0 => Test::Range(one, two),
            1 => Test::Dual(one, two),
            2 => Test::Classic(one, two),
            _ => Test::Never,
        };
        if code != 0 && test.passes(id) {
            return Some(Verdict::of(code, index as u8));
        }
    }
    None
}

fn extended(id: u32, registers: &Registers, occupied: u64, ctx: &mut Context) -> Option<Verdict> {
    let base = registers.field(XIDFC, 0, 16);
    let masked = id & registers.get(XIDAM);
    for index in 0..registers.field(XIDFC, 16, 7).min(64) {
        let (first, second) = (ram::read(base + 8 * index, ctx), ram::read(base + 8 * index + 4, ctx));
        let (code, one, two) = (first >> 29, first & 0x1fff_ffff, second & 0x1fff_ffff);
        if code == 7 {
            if let Some(verdict) = buffer(masked == one, two, index as u8, occupied) {
                return Some(verdict);
            }
            continue;
        }
        let (test, id) = match second >> 30 {
            0 => (Test::Range(one, two), masked),
            1 => (Test::Dual(one, two), masked),
            2 => (Test::Classic(one, two), masked),
            _ => (Test::Range(one, two), id),
        };
        if code != 0 && test.passes(id) {
            return Some(Verdict::of(code, index as u8));
        }
    }
    None
}

/// An element that stores into a dedicated buffer. Bits 9 and 10 of `which` would make it a debug message.
fn buffer(matches: bool, which: u32, filter: u8, occupied: u64) -> Option<Verdict> {
    let number = (which & 0x3f) as u8;
    (matches && which >> 9 & 3 == 0 && occupied >> number & 1 == 0).then_some(Verdict {
        target: Target::Buffer(number),
        filter: Some(filter),
        priority: false,
    })
}
