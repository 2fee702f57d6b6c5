//! SERCOM as UART and as SPI host (data sheet: "SERCOM USART", "SERCOM SPI").
//!
//! ```text
//!  DATA ─► buffer ─► shifter ─► wires          wires ─► two characters ─► DATA
//!          DRE       TXC                                RXC, BUFOVF
//! ```
//!
//! Characters take the time that BAUD and the core clock give. The other modes, parity, break, and what else is switched
//! on and not modelled, is reported.

mod line;
mod modes;

use super::Model;
use super::registers::{SyncBusy, crossing};
use crate::clocks::Hertz;
use crate::context::Context;
use crate::dma_trigger::DmaTrigger;
use crate::irq::Irq;
use crate::reset::Reset;
use crate::time::Cycles;
use crate::violation::Kind;
use crate::width::Width;

use line::Line;
use modes::{Mode, map};

const CTRLA: u32 = 0x00;
const CTRLB: u32 = 0x04;
const CTRLC: u32 = 0x08;
const BAUD: u32 = 0x0c;
const RXPL: u32 = 0x0e;
const INTENCLR: u32 = 0x14;
const INTENSET: u32 = 0x16;
const INTFLAG: u32 = 0x18;
const STATUS: u32 = 0x1a;
const SYNCBUSY: u32 = 0x1c;
const ADDR: u32 = 0x24;
const DATA: u32 = 0x28;
const DBGCTRL: u32 = 0x30;

const A_SWRST: u32 = 1 << 0;
const A_ENABLE: u32 = 1 << 1;
const B_TXEN: u32 = 1 << 16;
const B_RXEN: u32 = 1 << 17;

const INT_DRE: u32 = 1 << 0;
const INT_TXC: u32 = 1 << 1;
const INT_RXC: u32 = 1 << 2;
const INT_ERROR: u32 = 1 << 7;

const STATUS_FERR: u32 = 1 << 1;
const STATUS_BUFOVF: u32 = 1 << 2;

/// SYNCBUSY bits.
const SYNC_SWRST: u32 = 0;
const SYNC_ENABLE: u32 = 1;
const SYNC_CTRLB: u32 = 2;

/// GCLK channels of the cores.
const CORE: [usize; 6] = [19, 20, 21, 22, 23, 25];

const IRQ: [Irq; 6] = [Irq::Sercom0, Irq::Sercom1, Irq::Sercom2, Irq::Sercom3, Irq::Sercom4, Irq::Sercom5];

/// Triggers: byte received, ready for a byte.
const TRIGGERS: [[DmaTrigger; 2]; 6] = [
    [DmaTrigger::Sercom0Rx, DmaTrigger::Sercom0Tx],
    [DmaTrigger::Sercom1Rx, DmaTrigger::Sercom1Tx],
    [DmaTrigger::Sercom2Rx, DmaTrigger::Sercom2Tx],
    [DmaTrigger::Sercom3Rx, DmaTrigger::Sercom3Tx],
    [DmaTrigger::Sercom4Rx, DmaTrigger::Sercom4Tx],
    [DmaTrigger::Sercom5Rx, DmaTrigger::Sercom5Tx],
];

/// One SERCOM.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Sercom {
    index: usize,
    control: u32,
    control_b: u32,
    control_c: u32,
    baud: u32,
    pulse: u32,
    address: u32,
    debug: u32,
    enabled_interrupts: u32,
    status: u32,
    /// TXC and ERROR; DRE and RXC follow from the line.
    flags: u32,
    sync: SyncBusy,
    line: Line,
}

impl Sercom {
    /// SERCOM0 to SERCOM5.
    pub fn new(index: usize) -> Self {
        Sercom { index, ..Sercom::default() }
    }

    fn core(&self, ctx: &Context) -> Option<Hertz> {
        ctx.clocks.generic[CORE[self.index]]
    }

    fn mode(&self) -> Mode {
        Mode::of(self.control)
    }

    fn enabled(&self) -> bool {
        self.control & A_ENABLE != 0
    }

    fn receives(&self) -> bool {
        self.enabled() && self.control_b & B_RXEN != 0
    }

    fn transmits(&self) -> bool {
        self.enabled() && (self.mode() == Mode::SpiHost || self.control_b & B_TXEN != 0)
    }

    fn interrupt_flags(&self) -> u32 {
        let ready = if self.transmits() && self.line.has_room() { INT_DRE } else { 0 };
        let received = if self.line.has_received() { INT_RXC } else { 0 };
        self.flags | ready | received
    }

    /// After every change: interrupt line and DMA requests.
    fn update(&mut self, ctx: &mut Context) {
        let flags = self.interrupt_flags();
        ctx.set_irq(IRQ[self.index], flags & self.enabled_interrupts != 0);
        for (trigger, flag) in TRIGGERS[self.index].into_iter().zip([INT_RXC, INT_DRE]) {
            if flags & flag != 0 {
                ctx.trigger_dma(trigger);
            } else {
                ctx.withdraw_dma(trigger);
            }
        }
    }

    fn write_control_a(&mut self, value: u32, ctx: &mut Context) {
        if self.sync.refuses(1 << SYNC_SWRST | 1 << SYNC_ENABLE, ctx) {
            return;
        }
        let crossing = crossing(self.core(ctx), ctx);
        if value & A_SWRST != 0 {
            *self = Sercom::new(self.index);
            self.sync.start(SYNC_SWRST, crossing, ctx.now);
            self.sync.start(SYNC_ENABLE, crossing, ctx.now);
            return;
        }
        if self.enabled() && (value ^ self.control) & !A_ENABLE != 0 {
            ctx.report(Kind::EnableProtected);
            return;
        }
        let enables = value & A_ENABLE != 0;
        if enables != self.enabled() {
            self.sync.start(SYNC_ENABLE, crossing, ctx.now);
            if self.core(ctx).is_none() {
                ctx.report(Kind::Unclocked);
            }
        }
        let rises = enables && !self.enabled();
        self.control = value;
        if rises {
            self.check_mode(ctx);
            self.line = Line::default();
        } else if !enables {
            self.line = Line::default();
            self.flags = 0;
        }
        self.line.listen(&ctx.wires.serial[self.index]);
    }

    fn write_control_b(&mut self, value: u32, ctx: &mut Context) {
        if self.sync.refuses(1 << SYNC_CTRLB | 1 << SYNC_SWRST, ctx) {
            return;
        }
        if self.enabled() {
            if (value ^ self.control_b) & !(B_TXEN | B_RXEN) != 0 {
                return ctx.report(Kind::EnableProtected);
            }
            let crossing = crossing(self.core(ctx), ctx);
            self.sync.start(SYNC_CTRLB, crossing, ctx.now);
        }
        self.control_b = value;
    }

    fn write_data(&mut self, value: u32, ctx: &mut Context) {
        if !self.transmits() {
            return ctx.report(Kind::Misuse("DATA written while nothing is sent"));
        }
        if !self.line.has_room() {
            return ctx.report(Kind::Misuse("DATA written before DRE is set: the character is lost"));
        }
        let Some(ticks) = self.character(ctx) else { return ctx.report(Kind::Unclocked) };
        self.flags &= !INT_TXC;
        self.line.put(value as u16, ticks, ctx.now);
    }

    /// A character has left the shifter at `at`.
    fn sent(&mut self, character: u16, at: Cycles, ctx: &mut Context) {
        let received = match self.mode() {
            Mode::SpiHost => Some(self.exchange(character, at, ctx)),
            _ => {
                self.transmit(character, at, ctx);
                None
            }
        };
        if let Some(received) = received
            && self.receives()
        {
            self.accept(received, false);
        }
        if !self.line.is_sending() {
            self.flags |= INT_TXC;
        }
    }

    /// A character has been received.
    fn accept(&mut self, character: u8, framing_error: bool) {
        let overflow = !self.line.accept(character);
        for (bad, status) in [(framing_error, STATUS_FERR), (overflow, STATUS_BUFOVF)] {
            if bad {
                self.status |= status;
                self.flags |= INT_ERROR;
            }
        }
    }
}

impl Model for Sercom {
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32 {
        let Some(part) = map(self.mode()).read(offset, width, ctx) else { return 0 };
        part.of(match part.register {
            CTRLA => self.control,
            CTRLB => self.control_b,
            CTRLC => self.control_c,
            BAUD => self.baud,
            RXPL => self.pulse,
            INTENCLR | INTENSET => self.enabled_interrupts,
            INTFLAG => self.interrupt_flags(),
            STATUS => self.status,
            SYNCBUSY => self.sync.bits(ctx.now),
            ADDR => self.address,
            DATA => {
                let value = self.line.take();
                self.update(ctx);
                value.into()
            }
            _ => self.debug,
        })
    }

    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context) {
        // The bits that exist depend on the mode, and the first write of CTRLA names it.
        let mode = if offset == CTRLA && !self.enabled() { Mode::of(value) } else { self.mode() };
        let Some(part) = map(mode).write(offset, width, value, ctx) else { return };
        let ones = part.ones();
        match part.register {
            CTRLA => self.write_control_a(part.onto(self.control), ctx),
            CTRLB => self.write_control_b(part.onto(self.control_b), ctx),
            CTRLC | BAUD | RXPL | ADDR if self.sync.refuses(1 << SYNC_SWRST, ctx) => {}
            CTRLC | BAUD | RXPL | ADDR if self.enabled() => ctx.report(Kind::EnableProtected),
            CTRLC => self.control_c = part.onto(self.control_c),
            BAUD => self.baud = part.onto(self.baud),
            RXPL => self.pulse = ones,
            ADDR => self.address = part.onto(self.address),
            INTENCLR => self.enabled_interrupts &= !ones,
            INTENSET => self.enabled_interrupts |= ones,
            INTFLAG => self.flags &= !ones,
            STATUS => self.status &= !ones,
            DATA => self.write_data(part.onto(0), ctx),
            _ => self.debug = ones,
        }
        self.update(ctx);
    }

    fn next_event(&self) -> Option<Cycles> {
        self.line.next_event()
    }

    fn advance(&mut self, ctx: &mut Context) {
        while let Some((character, at)) = self.line.shifted(ctx.now) {
            // The next character follows without a gap.
            if let Some(ticks) = self.character(ctx) {
                self.line.shift_next(ticks, at);
            }
            self.sent(character, at, ctx);
        }
        self.listen(ctx);
        self.update(ctx);
    }

    const NOTICES: bool = true;

    fn notice(&mut self, ctx: &mut Context) {
        self.line.listen(&ctx.wires.serial[self.index]);
    }

    fn reset(&mut self, _cause: Reset, _ctx: &mut Context) {
        *self = Sercom::new(self.index);
    }
}
