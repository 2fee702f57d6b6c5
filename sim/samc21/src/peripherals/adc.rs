//! ADC0 and ADC1 (data sheet: "ADC – Analog-to-Digital Converter").
//!
//! A conversion samples the voltage on a wire at the end of its sampling time and takes as long as prescaler, sampling
//! time, resolution and averaging ask for. There is no noise: a voltage always gives the same count.
//!
//! Not modelled, and reported when switched on: window, events, client mode, inputs that are not pins.

mod conversion;

use super::Model;
use super::registers::{Map, Register, SyncBusy, crossing};
use super::signals::Signal;
use crate::clocks::Hertz;
use crate::context::Context;
use crate::dma_trigger::DmaTrigger;
use crate::irq::Irq;
use crate::reset::Reset;
use crate::time::Cycles;
use crate::violation::Kind;
use crate::width::Width;

use conversion::Conversion;

const CTRLA: u32 = 0x00;
const CTRLB: u32 = 0x01;
const REFCTRL: u32 = 0x02;
const EVCTRL: u32 = 0x03;
const INTENCLR: u32 = 0x04;
const INTENSET: u32 = 0x05;
const INTFLAG: u32 = 0x06;
const SEQSTATUS: u32 = 0x07;
const INPUTCTRL: u32 = 0x08;
const CTRLC: u32 = 0x0a;
const AVGCTRL: u32 = 0x0c;
const SAMPCTRL: u32 = 0x0d;
const WINLT: u32 = 0x0e;
const WINUT: u32 = 0x10;
const GAINCORR: u32 = 0x12;
const OFFSETCORR: u32 = 0x14;
const SWTRIG: u32 = 0x18;
const DBGCTRL: u32 = 0x1c;
const SYNCBUSY: u32 = 0x20;
const RESULT: u32 = 0x24;
const SEQCTRL: u32 = 0x28;
const CALIB: u32 = 0x2c;

const MAP: Map = Map(&[
    Register::new(CTRLA, Width::Byte, 0xe3),
    Register::new(CTRLB, Width::Byte, 0x07),
    Register::new(REFCTRL, Width::Byte, 0x8f),
    Register::new(EVCTRL, Width::Byte, 0x3f),
    Register::new(INTENCLR, Width::Byte, 0x07),
    Register::new(INTENSET, Width::Byte, 0x07),
    Register::new(INTFLAG, Width::Byte, 0x07),
    Register::read_only(SEQSTATUS, Width::Byte),
    Register::new(INPUTCTRL, Width::Half, 0x1f1f),
    Register::new(CTRLC, Width::Half, 0x37bf),
    Register::new(AVGCTRL, Width::Byte, 0x7f),
    Register::new(SAMPCTRL, Width::Byte, 0xbf),
    Register::new(WINLT, Width::Half, 0xffff),
    Register::new(WINUT, Width::Half, 0xffff),
    Register::new(GAINCORR, Width::Half, 0x0fff),
    Register::new(OFFSETCORR, Width::Half, 0x0fff),
    Register::new(SWTRIG, Width::Byte, 0x03),
    Register::new(DBGCTRL, Width::Byte, 0x01),
    Register::read_only(SYNCBUSY, Width::Half),
    Register::read_only(RESULT, Width::Half),
    Register::new(SEQCTRL, Width::Word, u32::MAX),
    Register::new(CALIB, Width::Half, 0x0707),
]);

const A_SWRST: u32 = 1 << 0;
const A_ENABLE: u32 = 1 << 1;
const A_SLAVEEN: u32 = 1 << 5;
const TRIG_FLUSH: u32 = 1 << 0;
const TRIG_START: u32 = 1 << 1;
const INT_RESRDY: u32 = 1 << 0;
const INT_OVERRUN: u32 = 1 << 1;
const C_DIFFMODE: u32 = 1 << 0;
const C_LEFTADJ: u32 = 1 << 1;
const C_FREERUN: u32 = 1 << 2;
const C_CORREN: u32 = 1 << 3;

const SYNC_SWRST: u32 = 0;
const SYNC_ENABLE: u32 = 1;

/// GCLK channel of ADC0; ADC1 has the next.
const CLOCK: usize = 33;
/// Fastest conversion clock, Hz (data sheet: electrical characteristics).
const FASTEST: u32 = 16_000_000;
/// NVM software calibration area: bias values of ADC0 in bits 0 to 5, of ADC1 in bits 6 to 11. The meaning of the bits is
/// UNVERIFIED, as in the firmware.
const FACTORY: u32 = 0x0080_6020;

/// SYNCBUSY bit of a register that has one.
const fn sync_bit(register: u32) -> Option<u32> {
    Some(match register {
        INPUTCTRL => 2,
        CTRLC => 3,
        AVGCTRL => 4,
        SAMPCTRL => 5,
        WINLT => 6,
        WINUT => 7,
        GAINCORR => 8,
        OFFSETCORR => 9,
        SWTRIG => 10,
        _ => return None,
    })
}

/// Where a register is kept: at its offset, CALIB in the last place, which no other takes.
const fn slot(register: u32) -> usize {
    if register == CALIB { 31 } else { register as usize & 31 }
}

/// One converter.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Adc {
    index: usize,
    /// Registers that keep what is written, by [`slot`].
    registers: [u16; 32],
    sequence: u32,
    enabled_interrupts: u32,
    flags: u32,
    result: u32,
    sync: SyncBusy,
    conversion: Option<Conversion>,
    /// START was written during a conversion.
    start_again: bool,
}

impl Adc {
    /// ADC0 or ADC1.
    pub fn new(index: usize) -> Self {
        Adc { index, ..Adc::default() }
    }

    fn clock(&self, ctx: &Context) -> Option<Hertz> {
        ctx.clocks.generic[CLOCK + self.index]
    }

    fn get(&self, register: u32) -> u32 {
        self.registers[slot(register)].into()
    }

    fn set(&mut self, register: u32, value: u32) {
        self.registers[slot(register)] = value as u16;
    }

    fn enabled(&self) -> bool {
        self.get(CTRLA) & A_ENABLE != 0
    }

    fn update(&mut self, ctx: &mut Context) {
        let (irq, trigger) = match self.index {
            0 => (Irq::Adc0, DmaTrigger::Adc0Resrdy),
            _ => (Irq::Adc1, DmaTrigger::Adc1Resrdy),
        };
        ctx.set_irq(irq, self.flags & self.enabled_interrupts != 0);
        match self.flags & INT_RESRDY {
            0 => ctx.withdraw_dma(trigger),
            _ => ctx.trigger_dma(trigger),
        }
    }

    fn write_control_a(&mut self, value: u32, ctx: &mut Context) {
        if self.sync.refuses(1 << SYNC_SWRST | 1 << SYNC_ENABLE, ctx) {
            return;
        }
        let crossing = crossing(self.clock(ctx), ctx);
        if value & A_SWRST != 0 {
            *self = Adc::new(self.index);
            self.sync.start(SYNC_SWRST, crossing, ctx.now);
            self.sync.start(SYNC_ENABLE, crossing, ctx.now);
            return;
        }
        if value & A_SLAVEEN != 0 {
            ctx.report(Kind::Unmodelled);
        }
        let enables = value & A_ENABLE != 0;
        if enables != self.enabled() {
            self.sync.start(SYNC_ENABLE, crossing, ctx.now);
            (self.conversion, self.start_again) = (None, false);
            if enables {
                self.check(ctx);
            }
        }
        self.set(CTRLA, value);
    }

    /// What is wrong with the settings of a converter that is being enabled.
    fn check(&self, ctx: &mut Context) {
        match self.clock(ctx) {
            None => ctx.report(Kind::Unclocked),
            Some(Hertz(hertz)) if hertz / self.prescaler() as u32 > FASTEST => {
                ctx.report(Kind::Misuse("ADC clock above 16 MHz"));
            }
            Some(_) => {}
        }
        let factory = ctx.nvm.read(FACTORY, Width::Word).unwrap_or(0) >> (6 * self.index);
        if self.get(CALIB) != (factory >> 3 & 7 | (factory & 7) << 8) {
            ctx.report(Kind::Misuse("ADC without the factory's calibration"));
        }
        if self.get(EVCTRL) != 0 {
            ctx.report(Kind::Unmodelled);
        }
        if !matches!(self.get(REFCTRL) & 15, 0..=2 | 5) {
            ctx.report(Kind::Unmodelled);
        }
    }

    fn write_trigger(&mut self, value: u32, ctx: &mut Context) {
        if value & TRIG_FLUSH != 0 {
            (self.conversion, self.start_again) = (None, false);
        }
        if value & TRIG_START == 0 {
            return;
        }
        if !self.enabled() {
            return ctx.report(Kind::Misuse("conversion started on an ADC that is off"));
        }
        match self.conversion {
            Some(_) => self.start_again = true,
            None => self.start(ctx.now, ctx),
        }
    }

    /// Starts a conversion, or a sequence of them.
    fn start(&mut self, at: Cycles, ctx: &mut Context) {
        let inputs = match self.sequence {
            0 => 1 << (self.get(INPUTCTRL) & 0x1f),
            sequence => sequence,
        };
        for input in (0..32).filter(|input| inputs >> input & 1 != 0) {
            if input >= 12 {
                ctx.report(Kind::Unmodelled);
            } else if !(Signal::Analogue { adc: self.index, input }).is_connected(&ctx.wires) {
                ctx.report(Kind::Misuse("conversion of an input whose pin is not analogue"));
            }
        }
        self.conversion = self.convert(inputs, at, ctx);
        if self.conversion.is_none() {
            ctx.report(Kind::Unclocked);
        }
    }

    /// A conversion is done.
    fn finish(&mut self, conversion: Conversion, ctx: &mut Context) {
        if self.flags & INT_RESRDY != 0 {
            self.flags |= INT_OVERRUN;
        }
        self.result = self.count(conversion.input, ctx);
        self.flags |= INT_RESRDY;
        let again = std::mem::take(&mut self.start_again) || self.get(CTRLC) & C_FREERUN != 0;
        self.conversion = match conversion.rest {
            0 if again => {
                self.start(conversion.done, ctx);
                self.conversion
            }
            0 => None,
            rest => {
                self.start_again = again && self.get(CTRLC) & C_FREERUN == 0;
                self.convert(rest, conversion.done, ctx)
            }
        };
    }
}

impl Model for Adc {
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32 {
        let Some(part) = MAP.read(offset, width, ctx) else { return 0 };
        part.of(match part.register {
            INTENCLR | INTENSET => self.enabled_interrupts,
            INTFLAG => self.flags,
            SEQSTATUS => match &self.conversion {
                Some(conversion) if self.sequence != 0 => conversion.input | 1 << 7,
                _ => 0,
            },
            SWTRIG => 0,
            SYNCBUSY => self.sync.bits(ctx.now),
            RESULT => {
                self.flags &= !INT_RESRDY;
                self.update(ctx);
                self.result
            }
            SEQCTRL => self.sequence,
            register => self.get(register),
        })
    }

    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context) {
        let Some(part) = MAP.write(offset, width, value, ctx) else { return };
        let ones = part.ones();
        let register = part.register;
        if let Some(bit) = sync_bit(register) {
            if self.sync.refuses(1 << bit | 1 << SYNC_SWRST, ctx) {
                return;
            }
            let crossing = crossing(self.clock(ctx), ctx);
            self.sync.start(bit, crossing, ctx.now);
        }
        match register {
            CTRLA => self.write_control_a(part.onto(self.get(CTRLA)), ctx),
            CTRLB | REFCTRL | EVCTRL | CALIB if self.enabled() => ctx.report(Kind::EnableProtected),
            INTENCLR => self.enabled_interrupts &= !ones,
            INTENSET => self.enabled_interrupts |= ones,
            INTFLAG => self.flags &= !ones,
            SWTRIG => self.write_trigger(ones, ctx),
            SEQCTRL => self.sequence = part.onto(self.sequence),
            _ => {
                if register == CTRLC && ones & 0x3700 != 0 {
                    ctx.report(Kind::Unmodelled);
                }
                let value = part.onto(self.get(register));
                self.set(register, value);
            }
        }
        self.update(ctx);
    }

    fn next_event(&self) -> Option<Cycles> {
        self.conversion.as_ref().map(|conversion| conversion.done)
    }

    fn advance(&mut self, ctx: &mut Context) {
        while let Some(conversion) = self.conversion.take_if(|conversion| conversion.done <= ctx.now) {
            self.finish(conversion, ctx);
            // Two results in one go would be overrun before DMA could take the first.
            if self.conversion.as_ref().is_some_and(|next| next.done <= ctx.now) {
                self.delay(ctx.now);
            }
        }
        self.update(ctx);
    }

    fn reset(&mut self, _cause: Reset, _ctx: &mut Context) {
        *self = Adc::new(self.index);
    }
}
