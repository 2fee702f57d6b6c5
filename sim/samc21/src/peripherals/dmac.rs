//! DMAC: moves data on requests of the peripherals (data sheet: "DMAC – Direct Memory Access Controller").
//!
//! A beat takes place as soon as its trigger comes, between two accesses of the CPU, and does not hold it up: the bus
//! matrix serves both, and what contention costs is not modelled. So no channel is ever seen as active.
//!
//! Not modelled, and reported when switched on: CRC, events.

mod channel;

use super::registers::{Map, Register};
use super::{Model, Peripherals};
use crate::context::Context;
use crate::irq::Irq;
use crate::violation::Kind;
use crate::width::Width;

use channel::Channel;

const CTRL: u32 = 0x00;
const CRCSTATUS: u32 = 0x0c;
const DBGCTRL: u32 = 0x0d;
const QOSCTRL: u32 = 0x0e;
const SWTRIGCTRL: u32 = 0x10;
const PRICTRL0: u32 = 0x14;
const INTPEND: u32 = 0x20;
const INTSTATUS: u32 = 0x24;
const BUSYCH: u32 = 0x28;
const PENDCH: u32 = 0x2c;
const ACTIVE: u32 = 0x30;
const BASEADDR: u32 = 0x34;
const WRBADDR: u32 = 0x38;
const CHID: u32 = 0x3f;
const CHCTRLA: u32 = 0x40;
const CHCTRLB: u32 = 0x44;
const CHINTENCLR: u32 = 0x4c;
const CHINTENSET: u32 = 0x4d;
const CHINTFLAG: u32 = 0x4e;
const CHSTATUS: u32 = 0x4f;

const MAP: Map = Map(&[
    Register::new(CTRL, Width::Half, 0x0f07),
    Register::new(0x02, Width::Half, 0x3f0f),
    Register::new(0x04, Width::Word, u32::MAX),
    Register::new(0x08, Width::Word, u32::MAX),
    Register::new(CRCSTATUS, Width::Byte, 0x03),
    Register::new(DBGCTRL, Width::Byte, 0x01),
    Register::new(QOSCTRL, Width::Byte, 0x3f),
    Register::new(SWTRIGCTRL, Width::Word, 0x0fff),
    Register::new(PRICTRL0, Width::Word, 0x8f8f_8f8f),
    Register::new(INTPEND, Width::Half, 0x070f),
    Register::read_only(INTSTATUS, Width::Word),
    Register::read_only(BUSYCH, Width::Word),
    Register::read_only(PENDCH, Width::Word),
    Register::read_only(ACTIVE, Width::Word),
    Register::new(BASEADDR, Width::Word, u32::MAX),
    Register::new(WRBADDR, Width::Word, u32::MAX),
    Register::new(CHID, Width::Byte, 0x0f),
    Register::new(CHCTRLA, Width::Byte, 0x43),
    Register::new(CHCTRLB, Width::Word, 0x03c0_3f7f),
    Register::new(CHINTENCLR, Width::Byte, 0x07),
    Register::new(CHINTENSET, Width::Byte, 0x07),
    Register::new(CHINTFLAG, Width::Byte, 0x07),
    Register::read_only(CHSTATUS, Width::Byte),
]);

const CTRL_SWRST: u32 = 1 << 0;
const CTRL_DMAENABLE: u32 = 1 << 1;
const CTRL_CRCENABLE: u32 = 1 << 2;

/// Channels of the chip.
const CHANNELS: usize = 12;

/// The controller.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Dmac {
    control: u32,
    debug: u32,
    quality: Option<u32>,
    priority: u32,
    base: u32,
    write_back: u32,
    selected: usize,
    channels: [Channel; CHANNELS],
    /// Channel and count of the last beat (ACTIVE).
    last: u32,
    /// Triggers that enabled channels wait for.
    listening: u64,
    /// A channel has something to do.
    ready: bool,
}

impl Dmac {
    /// Whether there is something to move.
    #[inline]
    pub fn has_work(&self, ctx: &Context) -> bool {
        ctx.dma_triggers() & self.listening != 0 || self.ready
    }

    /// Moves everything that is asked for.
    pub(super) fn run(&mut self, peripherals: &mut Peripherals, ctx: &mut Context) {
        loop {
            let triggers = ctx.dma_triggers() & self.listening;
            for channel in &mut self.channels {
                channel.pending |= channel.listens() & triggers != 0;
            }
            ctx.take_dma_triggers(triggers);
            let Some(number) = self.next_channel() else { break };
            let tables = channel::Tables::of(self.base, self.write_back, number);
            let left = self.channels[number].serve(tables, peripherals, ctx);
            self.last = (number as u32) << 8 | u32::from(left) << 16;
            self.update(ctx);
        }
    }

    /// The pending channel of the highest level, of equals the lowest number.
    #[inline]
    fn next_channel(&self) -> Option<usize> {
        if self.control & CTRL_DMAENABLE == 0 {
            return None;
        }
        let ready = |channel: &Channel| channel.is_ready() && self.control >> (8 + channel.level()) & 1 != 0;
        let mut best: Option<(usize, u32)> = None;
        for (number, channel) in self.channels.iter().enumerate() {
            if ready(channel) && best.is_none_or(|(_, level)| channel.level() > level) {
                best = Some((number, channel.level()));
            }
        }
        best.map(|(number, _)| number)
    }

    /// After a change: what is listened for, the interrupt line.
    fn update(&mut self, ctx: &mut Context) {
        self.listening = self.channels.iter().map(Channel::listens).fold(0, |all, one| all | one);
        self.ready = self.next_channel().is_some();
        ctx.set_irq(Irq::Dmac, self.channels.iter().any(Channel::interrupts));
    }

    fn bits(&self, test: impl Fn(&Channel) -> bool) -> u32 {
        self.channels.iter().enumerate().map(|(number, channel)| u32::from(test(channel)) << number).sum()
    }

    fn selected(&mut self) -> &mut Channel {
        &mut self.channels[self.selected]
    }

    fn write_ctrl(&mut self, value: u32, ctx: &mut Context) {
        if value & CTRL_SWRST != 0 {
            match self.control & (CTRL_DMAENABLE | CTRL_CRCENABLE) {
                0 => *self = Dmac::default(),
                _ => ctx.report(Kind::Misuse("software reset of a DMAC that is enabled")),
            }
            return;
        }
        if value & CTRL_CRCENABLE != 0 {
            ctx.report(Kind::Unmodelled);
        }
        if value & CTRL_DMAENABLE != 0 && (self.base | self.write_back) & 15 != 0 {
            ctx.report(Kind::Misuse("DMA descriptor tables must be 16-byte aligned"));
        }
        self.control = value;
    }
}

impl Model for Dmac {
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32 {
        let Some(part) = MAP.read(offset, width, ctx) else { return 0 };
        let channel = &self.channels[self.selected];
        part.of(match part.register {
            CTRL => self.control,
            DBGCTRL => self.debug,
            QOSCTRL => self.quality.unwrap_or(0x2a),
            PRICTRL0 => self.priority,
            INTPEND => match self.channels.iter().position(Channel::interrupts) {
                None => 0,
                Some(number) => number as u32 | self.channels[number].flags << 8,
            },
            INTSTATUS => self.bits(Channel::interrupts),
            PENDCH => self.bits(|channel| channel.pending),
            ACTIVE => self.last,
            BASEADDR => self.base,
            WRBADDR => self.write_back,
            CHID => self.selected as u32,
            CHCTRLA => channel.control_a(),
            CHCTRLB => channel.control,
            CHINTENCLR | CHINTENSET => channel.enabled_interrupts,
            CHINTFLAG => channel.flags,
            CHSTATUS => channel.status(),
            _ => 0,
        })
    }

    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context) {
        let Some(part) = MAP.write(offset, width, value, ctx) else { return };
        let enabled = self.control & CTRL_DMAENABLE != 0;
        let ones = part.ones();
        match part.register {
            CTRL => self.write_ctrl(part.onto(self.control), ctx),
            DBGCTRL => self.debug = ones,
            QOSCTRL => self.quality = Some(ones),
            SWTRIGCTRL => {
                for (number, channel) in self.channels.iter_mut().enumerate() {
                    channel.pending |= ones >> number & 1 != 0 && channel.enabled;
                }
            }
            PRICTRL0 => {
                if ones & 0x8080_8080 != 0 {
                    ctx.report(Kind::Unmodelled);
                }
                self.priority = part.onto(self.priority);
            }
            INTPEND => {
                let value = part.onto(0);
                match self.channels.get_mut(value as usize & 15) {
                    Some(channel) => channel.flags &= !(value >> 8 & 7),
                    None => ctx.report(Kind::ReservedValue),
                }
            }
            BASEADDR | WRBADDR if enabled => ctx.report(Kind::EnableProtected),
            BASEADDR => self.base = part.onto(self.base),
            WRBADDR => self.write_back = part.onto(self.write_back),
            CHID if ones as usize >= CHANNELS => ctx.report(Kind::ReservedValue),
            CHID => self.selected = ones as usize,
            CHCTRLA => {
                let levels = self.control >> 8;
                self.selected().write_control_a(ones, levels, ctx);
            }
            CHCTRLB => {
                let value = part.onto(self.channels[self.selected].control);
                self.selected().write_control_b(value, ctx);
            }
            CHINTENCLR => self.selected().enabled_interrupts &= !ones,
            CHINTENSET => self.selected().enabled_interrupts |= ones,
            CHINTFLAG => self.selected().flags &= !ones,
            _ => ctx.report(Kind::Unmodelled),
        }
        self.update(ctx);
    }
}
