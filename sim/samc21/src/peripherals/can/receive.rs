//! Receive FIFOs and dedicated receive buffers (M_CAN User's Manual, 3.4 "Rx Handling").

use super::filter::{self, Target};
use super::ram::{self, Passed, element_bytes};
use super::registers::*;
use crate::context::Context;
use crate::violation::Kind;
use crate::wires::CanFrame;

/// Indices of a ring of elements.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Ring {
    /// Oldest element.
    pub get: u32,
    /// Where the next one goes.
    pub put: u32,
    /// Elements held.
    pub fill: u32,
}

impl Ring {
    /// Makes room for one more at the end; its index.
    pub fn push(&mut self, size: u32) -> u32 {
        let index = self.put;
        self.put = (self.put + 1) % size.max(1);
        self.fill += 1;
        index
    }

    /// Forgets the oldest.
    pub fn drop_oldest(&mut self, size: u32) {
        self.get = (self.get + 1) % size.max(1);
        self.fill = self.fill.saturating_sub(1);
    }

    /// Firmware has read up to and including element `index`. False: that is none of those held.
    pub fn acknowledge(&mut self, index: u32, size: u32) -> bool {
        let size = size.max(1);
        let read = (index + size - self.get) % size + 1;
        let valid = index < size && read <= self.fill;
        if valid {
            self.get = (index + 1) % size;
            self.fill -= read;
        }
        valid
    }
}

/// State of the receive side.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Receive {
    fifos: [Ring; 2],
    /// Dedicated buffers that hold an unread message (NDAT1, NDAT2).
    pub new_data: u64,
    /// High-priority message status.
    pub priority: u32,
}

const CONFIGURATION: [u32; 2] = [RXF0C, RXF1C];

impl Receive {
    /// What setting CCE resets: all but the new data flags.
    pub fn clear(&mut self) {
        *self = Receive { new_data: self.new_data, ..Receive::default() };
    }

    /// RXF0S or RXF1S; the copy of the lost flag comes from IR.
    pub fn status(&self, fifo: usize, registers: &Registers, flags: u32) -> u32 {
        let ring = &self.fifos[fifo];
        let full = ring.fill != 0 && ring.fill >= size(fifo, registers);
        let lost = flags >> (3 + 4 * fifo) & 1;
        ring.fill | ring.get << 8 | ring.put << 16 | u32::from(full) << 24 | lost << 25
    }

    /// RXF0A or RXF1A.
    pub fn acknowledge(&mut self, fifo: usize, index: u32, registers: &Registers, ctx: &mut Context) {
        if !self.fifos[fifo].acknowledge(index, size(fifo, registers)) {
            ctx.report(Kind::Misuse("acknowledges a FIFO element that holds no message"));
        }
    }

    /// Filters and stores a frame; the interrupt flags it raises.
    pub fn accept(&mut self, frame: &CanFrame, timestamp: u16, registers: &Registers, ctx: &mut Context) -> u32 {
        let verdict = filter::judge(frame, registers, self.new_data, ctx);
        let passed = Passed { filter: verdict.filter, timestamp };
        let (mut flags, stored) = match verdict.target {
            Target::Reject => return 0,
            Target::Tell => (0, (0, 0)),
            Target::Fifo(fifo) => self.put(fifo, frame, passed, registers, ctx),
            Target::Buffer(number) => {
                let room = element_bytes(registers.field(RXESC, 8, 3));
                let base = registers.field(RXBC, 0, 16) + u32::from(number) * (8 + room);
                ram::store(frame, passed, base, room, ctx);
                self.new_data |= 1 << number;
                (flag::DRX, (0, 0))
            }
        };
        if verdict.priority {
            let (storage, index) = stored;
            let list = u32::from(frame.extended) << 15;
            self.priority = index | storage << 6 | u32::from(verdict.filter.unwrap_or(0)) << 8 | list;
            flags |= flag::HPM;
        }
        flags
    }

    /// Stores into a FIFO: the flags, and where (HPMS.MSI and BIDX).
    fn put(
        &mut self,
        fifo: usize,
        frame: &CanFrame,
        passed: Passed,
        registers: &Registers,
        ctx: &mut Context,
    ) -> (u32, (u32, u32)) {
        let shift = 4 * fifo as u32;
        let (configuration, size) = (CONFIGURATION[fifo], size(fifo, registers));
        let overwrites = registers.field(configuration, 31, 1) != 0;
        let ring = &mut self.fifos[fifo];
        if size == 0 || ring.fill >= size && !overwrites {
            return (flag::RF0L << shift, (1, 0));
        }
        if ring.fill >= size {
            ring.drop_oldest(size);
        }
        let index = ring.push(size);
        let room = element_bytes(registers.field(RXESC, 4 * fifo as u32, 3));
        ram::store(frame, passed, registers.field(configuration, 0, 16) + index * (8 + room), room, ctx);
        let watermark = registers.field(configuration, 24, 7);
        let mut flags = flag::RF0N;
        if watermark != 0 && ring.fill == watermark {
            flags |= flag::RF0W;
        }
        if ring.fill == size {
            flags |= flag::RF0F;
        }
        (flags << shift, (2 + fifo as u32, index))
    }
}

/// Elements of a FIFO; at most 64.
fn size(fifo: usize, registers: &Registers) -> u32 {
    registers.field(CONFIGURATION[fifo], 16, 7).min(64)
}
