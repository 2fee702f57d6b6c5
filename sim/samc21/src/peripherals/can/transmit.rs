//! Transmit buffers, FIFO and queue, and the event FIFO (M_CAN User's Manual, 3.5 "Tx Handling").
//!
//! ```text
//!  buffers 0 .. NDTB: dedicated │ NDTB .. NDTB + TFQS: FIFO (in the order of requests) or queue (by identifier)
//! ```

use super::ram::{self, Outgoing};
use super::receive::Ring;
use super::registers::*;
use crate::can_bus::bits::priority;
use crate::context::Context;
use crate::violation::Kind;

/// State of the transmit side.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Transmit {
    /// TXBRP.
    pub pending: u32,
    /// TXBTO.
    pub occurred: u32,
    /// TXBCF.
    pub cancelled: u32,
    /// Cancellation asked for while on the wire.
    cancelling: u32,
    /// FIFO indices, relative to the first FIFO buffer.
    fifo: Ring,
    events: Ring,
    /// The buffer offered to the bus, and what is in it.
    offered: Option<(u32, Outgoing)>,
}

/// How an attempt to send ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Outcome {
    /// Sent and acknowledged.
    Sent,
    /// Lost arbitration, or an error.
    Failed,
}

struct Layout {
    dedicated: u32,
    shared: u32,
    queue: bool,
}

impl Layout {
    fn of(registers: &Registers) -> Layout {
        let dedicated = registers.field(TXBC, 16, 6).min(32);
        Layout {
            dedicated,
            shared: registers.field(TXBC, 24, 6).min(32 - dedicated),
            queue: registers.field(TXBC, 30, 1) != 0,
        }
    }

    fn all(&self) -> u32 {
        mask(self.dedicated + self.shared)
    }

    fn is_fifo(&self, index: u32) -> bool {
        !self.queue && index >= self.dedicated
    }
}

const fn mask(bits: u32) -> u32 {
    if bits >= 32 { u32::MAX } else { (1 << bits) - 1 }
}

impl Transmit {
    /// TXBAR: requests; what the firmware does wrong is reported.
    pub fn request(&mut self, bits: u32, registers: &Registers, ctx: &mut Context) {
        let layout = Layout::of(registers);
        if bits & !layout.all() != 0 {
            ctx.report(Kind::Misuse("requests a transmit buffer that TXBC does not configure"));
        }
        if bits & self.pending != 0 {
            ctx.report(Kind::Misuse("requests a transmit buffer that is still pending"));
        }
        let new = bits & layout.all() & !self.pending;
        self.occurred &= !new;
        self.cancelled &= !new;
        self.pending |= new;
        let fifo = if layout.queue { 0 } else { (new & !mask(layout.dedicated)).count_ones() };
        for _ in 0..fifo {
            let put = layout.dedicated + self.fifo.push(layout.shared);
            if new >> put & 1 == 0 {
                ctx.report(Kind::Misuse("requests a FIFO buffer that is not at the put index"));
            }
        }
    }

    /// TXBCR: cancellations; interrupt flags. What is on the wire cannot be stopped.
    pub fn cancel(&mut self, bits: u32, transmitting: bool, registers: &Registers) -> u32 {
        let bits = bits & self.pending;
        let on_wire = match &self.offered {
            Some((index, _)) if transmitting => 1 << index,
            _ => 0,
        };
        self.cancelling |= bits & on_wire;
        self.finish_cancelling(bits & !on_wire, registers)
    }

    fn finish_cancelling(&mut self, bits: u32, registers: &Registers) -> u32 {
        self.pending &= !bits;
        self.cancelled |= bits;
        self.cancelling &= !bits;
        self.skip_done(registers);
        if bits & registers.get(TXBCIE) != 0 { flag::TCF } else { 0 }
    }

    /// Moves the FIFO's get index over buffers that are no longer pending.
    fn skip_done(&mut self, registers: &Registers) {
        let layout = Layout::of(registers);
        if layout.queue {
            return;
        }
        while self.fifo.fill > 0 && self.pending >> (layout.dedicated + self.fifo.get) & 1 == 0 {
            self.fifo.drop_oldest(layout.shared);
        }
    }

    /// An attempt to send the offered buffer has ended; interrupt flags.
    pub fn ended(&mut self, outcome: Outcome, timestamp: u16, registers: &Registers, ctx: &mut Context) -> u32 {
        let Some((index, outgoing)) = self.offered.take() else { return 0 };
        let bit = 1 << index;
        match outcome {
            Outcome::Failed if self.cancelling & bit != 0 || registers.cccr(CCCR_DAR) => {
                self.finish_cancelling(bit, registers)
            }
            Outcome::Failed => 0,
            Outcome::Sent => {
                let layout = Layout::of(registers);
                let mut flags = 0;
                self.pending &= !bit;
                self.occurred |= bit;
                if self.cancelling & bit != 0 {
                    flags |= self.finish_cancelling(bit, registers);
                }
                self.skip_done(registers);
                if layout.is_fifo(index) && self.fifo.fill == 0 {
                    flags |= flag::TFE;
                }
                if registers.get(TXBTIE) & bit != 0 {
                    flags |= flag::TC;
                }
                if outgoing.wants_event {
                    flags |= self.store_event(outgoing.event, timestamp, registers, ctx);
                }
                flags
            }
        }
    }

    fn store_event(&mut self, event: [u32; 2], timestamp: u16, registers: &Registers, ctx: &mut Context) -> u32 {
        let size = registers.field(TXEFC, 16, 6).min(32);
        if self.events.fill >= size {
            return flag::TEFL;
        }
        let base = registers.field(TXEFC, 0, 16) + 8 * self.events.push(size);
        ram::write(base, event[0], ctx);
        ram::write(base + 4, event[1] | u32::from(timestamp), ctx);
        let watermark = registers.field(TXEFC, 24, 6);
        let mut flags = flag::TEFN;
        if watermark != 0 && self.events.fill == watermark {
            flags |= flag::TEFW;
        }
        if self.events.fill == size {
            flags |= flag::TEFF;
        }
        flags
    }

    /// TXEFA.
    pub fn acknowledge_event(&mut self, index: u32, registers: &Registers, ctx: &mut Context) {
        if !self.events.acknowledge(index, registers.field(TXEFC, 16, 6).min(32)) {
            ctx.report(Kind::Misuse("acknowledges an event element that holds no event"));
        }
    }

    /// TXEFS; the copy of the lost flag comes from IR.
    pub fn event_status(&self, registers: &Registers, flags: u32) -> u32 {
        let size = registers.field(TXEFC, 16, 6);
        let full = self.events.fill != 0 && self.events.fill >= size;
        let lost = u32::from(flags & flag::TEFL != 0);
        self.events.fill | self.events.get << 8 | self.events.put << 16 | u32::from(full) << 24 | lost << 25
    }

    /// TXFQS. Indices count from buffer 0.
    pub fn status(&self, registers: &Registers) -> u32 {
        let layout = Layout::of(registers);
        if layout.queue {
            let free = !self.pending & layout.all() & !mask(layout.dedicated);
            return match free {
                0 => 1 << 21,
                free => free.trailing_zeros() << 16,
            };
        }
        if layout.shared == 0 {
            return 1 << 21;
        }
        let full = self.fifo.fill >= layout.shared;
        (layout.shared - self.fifo.fill)
            | (layout.dedicated + self.fifo.get) << 8
            | (layout.dedicated + self.fifo.put) << 16
            | u32::from(full) << 21
    }

    /// Chooses the buffer to send next: the lowest identifier among the dedicated buffers and the FIFO's oldest or the
    /// whole queue; of equals, the lowest buffer.
    pub fn choose(&mut self, registers: &Registers, ctx: &mut Context) -> Option<Outgoing> {
        let layout = Layout::of(registers);
        let mut candidates = self.pending;
        if !layout.queue {
            candidates &= mask(layout.dedicated);
            if self.fifo.fill > 0 {
                candidates |= self.pending & 1 << (layout.dedicated + self.fifo.get);
            }
        }
        let mut best: Option<(u32, Outgoing)> = None;
        for index in (0..32).filter(|index| candidates >> index & 1 != 0) {
            let outgoing = Outgoing::read(index, registers, ctx);
            if best.as_ref().is_none_or(|(_, other)| priority(&outgoing.frame) < priority(&other.frame)) {
                best = Some((index, outgoing));
            }
        }
        self.offered = best;
        best.map(|(_, outgoing)| outgoing)
    }
}
