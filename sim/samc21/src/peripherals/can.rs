//! CAN0 and CAN1: Bosch M_CAN, ISO CAN-FD (data sheet: "CAN – Control Area Network"; M_CAN User's Manual 3.2.1).
//!
//! ```text
//!  registers ─┬─ transmit ─ offers the next frame ─► wires.can ─► can_bus
//!             ├─ receive  ◄─ filter ◄─ events ◄───── wires.can ◄─ can_bus
//!             ├─ errors   ◄─ events
//!             └─ ram: elements in the chip's SRAM
//! ```
//!
//! Not modelled, and reported when switched on: loop back, timeout counter, debug messages, the DMA request.

mod errors;
mod filter;
mod ram;
mod receive;
mod registers;
#[cfg(test)]
mod tests;
mod transmit;

use super::Model;
use super::signals::Signal;
use crate::context::Context;
use crate::irq::Irq;
use crate::reset::Reset;
use crate::time::Cycles;
use crate::violation::Kind;
use crate::width::Width;
use crate::wires::{CanEvent, CanTiming};

use errors::Errors;
use receive::Receive;
use registers::*;
use transmit::{Outcome, Transmit};

/// GCLK channel of CAN0; CAN1 has the next.
const CLOCK: usize = 26;
/// Sequences of recessive bits before a controller takes part, and those after bus-off.
const INTEGRATION: u16 = 1;
const RECOVERY: u16 = 129;
/// From the transmit to the receive pin through the transceiver: 125 ns, a usual value.
const LOOP_DELAY: u32 = 6;
/// INIT passes into the CAN clock domain and back. The manual gives no figure: assumption, in CAN clock periods.
const SYNCHRONISATION: u64 = 8;

/// One controller.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Can {
    index: usize,
    registers: Registers,
    flags: u32,
    receive: Receive,
    transmit: Transmit,
    errors: Errors,
    /// INIT as written, until it reads back so.
    init: Option<(Cycles, bool)>,
    joined: bool,
    timing: Option<CanTiming>,
    delay: u32,
    counting_since: Cycles,
    wraps: u64,
    next: Option<Cycles>,
}

impl Can {
    /// CAN0 or CAN1.
    pub fn new(index: usize) -> Self {
        Can { index, ..Can::default() }
    }

    fn hertz(&self, ctx: &Context) -> Option<u32> {
        ctx.clocks.generic[CLOCK + self.index].map(|hertz| hertz.0).filter(|hertz| *hertz != 0)
    }

    /// Raises interrupt flags.
    fn raise(&mut self, flags: u32, ctx: &mut Context) {
        self.flags |= flags;
        self.update_irq(ctx);
    }

    /// Both lines of the controller end in one of the NVIC.
    fn update_irq(&self, ctx: &mut Context) {
        let active = self.flags & self.registers.get(IE);
        let (select, enable) = (self.registers.get(ILS), self.registers.get(ILE));
        let asserted = active & !select != 0 && enable & 1 != 0 || active & select != 0 && enable & 2 != 0;
        ctx.set_irq(if self.index == 0 { Irq::Can0 } else { Irq::Can1 }, asserted);
    }

    /// Time stamp counter: external counting is not connected in this chip.
    fn timestamp(&self, ctx: &Context) -> u64 {
        match (self.registers.field(TSCC, 0, 2), self.timing) {
            (1, Some(timing)) => ctx.now.since(self.counting_since) / self.timestamp_period(timing),
            _ => 0,
        }
    }

    fn timestamp_period(&self, timing: CanTiming) -> u64 {
        u64::from(timing.nominal) * u64::from(self.registers.field(TSCC, 16, 4) + 1)
    }

    fn write_cccr(&mut self, value: u32, ctx: &mut Context) {
        let old = self.registers.get(CCCR);
        let configurable = self.registers.cccr(CCCR_INIT | CCCR_CCE);
        let mut new = value & CCCR_WRITABLE | old & CCCR_CSA;
        if !configurable {
            let kept = (new ^ old) & CCCR_PROTECTED | new & !old & CCCR_SET_PROTECTED;
            if kept != 0 {
                ctx.report(Kind::EnableProtected);
            }
            new = new & !kept | old & kept;
        }
        // CCE follows INIT; it can be set only while INIT reads as set.
        if new & CCCR_CCE != 0 && old & CCCR_INIT == 0 {
            ctx.report(Kind::EnableProtected);
            new &= !CCCR_CCE;
        }
        if new & CCCR_CCE != 0 && old & CCCR_CCE == 0 {
            self.transmit = Transmit::default();
            self.receive.clear();
        }
        let wanted = new & CCCR_INIT != 0;
        match self.init {
            Some((_, pending)) if pending != wanted => ctx.report(Kind::SyncBusy),
            Some(_) => {}
            None if wanted != (old & CCCR_INIT != 0) => self.request_init(wanted, ctx),
            None => {}
        }
        if new & CCCR_CSR != 0 && old & CCCR_CSR == 0 {
            self.leave(ctx);
            new |= CCCR_CSA;
        } else if new & CCCR_CSR == 0 {
            new &= !CCCR_CSA;
        }
        // INIT itself changes only when it has crossed the clock domains.
        let init = if new & CCCR_CSA != 0 { CCCR_INIT } else { old & CCCR_INIT };
        self.registers.set(CCCR, new & !CCCR_INIT | init);
    }

    fn request_init(&mut self, wanted: bool, ctx: &mut Context) {
        match self.hertz(ctx) {
            None => ctx.report(Kind::Unclocked),
            Some(hertz) => {
                self.init = Some((ctx.now + SYNCHRONISATION * Cycles::HZ / u64::from(hertz), wanted));
            }
        }
    }

    /// INIT has been taken over.
    fn apply_init(&mut self, init: bool, ctx: &mut Context) {
        let cccr = self.registers.get(CCCR);
        if init {
            self.registers.set(CCCR, cccr | CCCR_INIT);
            self.leave(ctx);
        } else {
            self.registers.set(CCCR, cccr & !(CCCR_INIT | CCCR_CCE));
            self.join(ctx);
        }
    }

    fn leave(&mut self, ctx: &mut Context) {
        ctx.wires.can[self.index].leave();
        self.joined = false;
    }

    fn join(&mut self, ctx: &mut Context) {
        let Some(hertz) = self.hertz(ctx) else { return ctx.report(Kind::Unclocked) };
        let timing = self.registers.timing(hertz);
        if timing.nominal == 0 || timing.data == 0 {
            return ctx.report(Kind::Misuse("bit shorter than the emulator's clock"));
        }
        if self.registers.cccr(CCCR_TEST) && self.registers.get(TEST) & TEST_LBCK != 0
            || self.registers.get(TOCC) & 1 != 0
        {
            ctx.report(Kind::Unmodelled);
        }
        let switches = self.registers.cccr(CCCR_FDOE | CCCR_BRSE);
        if switches && self.registers.get(DBTP) & DBTP_TDC == 0 && timing.data_sample <= LOOP_DELAY {
            ctx.report(Kind::Misuse("data bit sampled before it is back from the transceiver, without compensation"));
        }
        for signal in 0..2 {
            if !(Signal::Can { controller: self.index, signal }).is_connected(&ctx.wires) {
                ctx.report(Kind::Misuse("joins the bus, but no pin is switched to the controller"));
            }
        }
        self.timing = Some(timing);
        let port = &mut ctx.wires.can[self.index];
        port.timing = Some(timing);
        port.joining = if self.errors.is_bus_off() { RECOVERY } else { INTEGRATION };
        port.fd = self.registers.cccr(CCCR_FDOE);
        port.silent = self.registers.cccr(CCCR_MON);
        port.passive = self.errors.is_passive();
    }

    /// Offers the frame that should go next, unless one is on the wire.
    fn offer(&mut self, ctx: &mut Context) {
        let port = &ctx.wires.can[self.index];
        if port.transmitting {
            return;
        }
        let listens = self.registers.get(CCCR) & (CCCR_MON | CCCR_ASM) != 0;
        let sends = self.joined && port.timing.is_some() && !listens;
        let before = port.offered;
        let chosen = if sends { self.transmit.choose(&self.registers, ctx) } else { None };
        let passive = self.errors.is_passive();
        ctx.wires.can[self.index].offered = chosen.map(|outgoing| {
            let mut frame = outgoing.frame;
            frame.error_state |= frame.fd && passive;
            match before {
                Some((since, other)) if other == frame => (since, frame),
                _ => (ctx.now, frame),
            }
        });
    }

    fn react(&mut self, event: CanEvent, ctx: &mut Context) {
        let timestamp = self.timestamp(ctx) as u16;
        let flags = match event {
            CanEvent::Joined => {
                self.joined = true;
                if self.errors.is_bus_off() { self.errors.recovered() } else { 0 }
            }
            CanEvent::Received(frame) => {
                let counted = self.errors.received(frame.fd, frame.bit_rate_switch, frame.error_state);
                counted | self.receive.accept(&frame, timestamp, &self.registers, ctx)
            }
            CanEvent::Sent => {
                ctx.wires.can[self.index].transmitting = false;
                if ctx.wires.can[self.index].offered.is_some_and(|(_, frame)| frame.bit_rate_switch)
                    && self.registers.get(DBTP) & DBTP_TDC != 0
                {
                    self.delay = (LOOP_DELAY + self.registers.field(TDCR, 8, 7)).min(127);
                }
                self.errors.sent() | self.transmit.ended(Outcome::Sent, timestamp, &self.registers, ctx)
            }
            CanEvent::ArbitrationLost => self.transmit.ended(Outcome::Failed, timestamp, &self.registers, ctx),
            CanEvent::Error { error, sending, data_phase, weight } => {
                let mut flags = self.errors.error(error, sending, data_phase, weight);
                if sending {
                    ctx.wires.can[self.index].transmitting = false;
                    flags |= self.transmit.ended(Outcome::Failed, timestamp, &self.registers, ctx);
                }
                flags
            }
        };
        ctx.wires.can[self.index].passive = self.errors.is_passive();
        if self.errors.is_bus_off() && self.joined {
            // The controller stops by itself; only software starts it again.
            self.apply_init(true, ctx);
        }
        self.raise(flags, ctx);
    }

    /// When the next thing happens.
    fn plan(&mut self, ctx: &Context) {
        let event = ctx.wires.can[self.index].events.front().map(|(at, _)| *at);
        let init = self.init.map(|(at, _)| at);
        let wrap = match (self.registers.field(TSCC, 0, 2), self.timing) {
            (1, Some(timing)) => Some(self.counting_since + ((self.wraps + 1) << 16) * self.timestamp_period(timing)),
            _ => None,
        };
        self.next = [event, init, wrap].into_iter().flatten().min();
    }
}

impl Model for Can {
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32 {
        let register = offset & !3;
        if rule(register).is_none() {
            ctx.report(Kind::NoRegister);
            return 0;
        }
        let value = match register {
            TEST => self.registers.get(TEST) | 1 << 7,
            TSCV => self.timestamp(ctx) as u32 & 0xffff,
            ECR => self.errors.read_counters(),
            PSR => {
                let port = &ctx.wires.can[self.index];
                let activity = match (self.joined, port.transmitting) {
                    (false, _) => 0,
                    (true, false) => 1,
                    (true, true) => 3,
                };
                self.errors.read_status() | activity << 3 | self.delay << 16
            }
            IR => self.flags,
            HPMS => self.receive.priority,
            NDAT1 => self.receive.new_data as u32,
            NDAT2 => (self.receive.new_data >> 32) as u32,
            RXF0S => self.receive.status(0, &self.registers, self.flags),
            RXF1S => self.receive.status(1, &self.registers, self.flags),
            TXFQS => self.transmit.status(&self.registers),
            TXBRP => self.transmit.pending,
            TXBTO => self.transmit.occurred,
            TXBCF => self.transmit.cancelled,
            TXEFS => self.transmit.event_status(&self.registers, self.flags),
            // Requests are taken over at once.
            TXBAR | TXBCR => 0,
            _ => self.registers.get(register),
        };
        let _ = width;
        value >> (8 * (offset & 3))
    }

    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context) {
        let Some((writable, when)) = rule(offset & !3) else { return ctx.report(Kind::NoRegister) };
        if width != Width::Word {
            return ctx.report(Kind::WrongWidth);
        }
        // TEST.RX and CCCR.CSA show states; software that writes back what it read does no harm.
        let shown = match offset {
            TEST => 1 << 7,
            RWD => 0xff00,
            _ => 0,
        };
        if value & !(writable | shown) != 0 && when != Write::Never {
            ctx.report(Kind::ReservedBits(value & !(writable | shown)));
        }
        let value = value & writable;
        match when {
            Write::Never => ctx.report(Kind::ReadOnly),
            Write::Free => self.registers.set(offset, value),
            Write::Protected if self.registers.cccr(CCCR_INIT | CCCR_CCE) => self.registers.set(offset, value),
            Write::Protected => {
                if value != self.registers.get(offset) {
                    ctx.report(Kind::EnableProtected);
                }
            }
            Write::Special => self.write_special(offset, value, ctx),
        }
        self.update_irq(ctx);
        self.offer(ctx);
        self.plan(ctx);
    }

    fn next_event(&self) -> Option<Cycles> {
        self.next
    }

    fn advance(&mut self, ctx: &mut Context) {
        if let Some((at, init)) = self.init
            && at <= ctx.now
        {
            self.init = None;
            self.apply_init(init, ctx);
        }
        while let Some((_, event)) = ctx.wires.can[self.index].events.pop_front_if(|(at, _)| *at <= ctx.now) {
            self.react(event, ctx);
        }
        let wraps = self.timestamp(ctx) >> 16;
        if wraps > self.wraps {
            self.wraps = wraps;
            self.raise(flag::TSW, ctx);
        }
        self.offer(ctx);
        self.plan(ctx);
    }

    const NOTICES: bool = true;

    fn notice(&mut self, ctx: &mut Context) {
        if self.joined && self.hertz(ctx).is_none() {
            ctx.report(Kind::Unclocked);
            self.leave(ctx);
        }
        self.plan(ctx);
    }

    fn reset(&mut self, _cause: Reset, _ctx: &mut Context) {
        *self = Can::new(self.index);
    }
}

impl Can {
    fn write_special(&mut self, offset: u32, value: u32, ctx: &mut Context) {
        match offset {
            CCCR => self.write_cccr(value, ctx),
            TEST => {
                let value = value & 0x70;
                if self.registers.cccr(CCCR_TEST) {
                    self.registers.set(TEST, value);
                } else if value != self.registers.get(TEST) {
                    ctx.report(Kind::EnableProtected);
                }
            }
            TSCV => (self.counting_since, self.wraps) = (ctx.now, 0),
            IR => self.flags &= !value,
            NDAT1 => self.receive.new_data &= !u64::from(value),
            NDAT2 => self.receive.new_data &= !(u64::from(value) << 32),
            RXF0A => self.receive.acknowledge(0, value, &self.registers, ctx),
            RXF1A => self.receive.acknowledge(1, value, &self.registers, ctx),
            TXBAR | TXBCR if self.registers.cccr(CCCR_CCE) => ctx.report(Kind::EnableProtected),
            TXBAR => self.transmit.request(value, &self.registers, ctx),
            TXBCR => {
                let transmitting = ctx.wires.can[self.index].transmitting;
                self.flags |= self.transmit.cancel(value, transmitting, &self.registers);
            }
            TXEFA => self.transmit.acknowledge_event(value, &self.registers, ctx),
            _ => {}
        }
    }
}
