//! The modes of a SERCOM: which register bits exist, how long a character takes, where it goes (data sheet: "SERCOM",
//! "Clock Generation – Baud-Rate Generator").

use super::*;
use crate::peripherals::registers::{Map, Register};
use crate::peripherals::signals::Signal;
use crate::wires::{Serial, UartByte};

/// What CTRLA.MODE selects.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Mode {
    /// UART with the internal clock.
    Uart,
    /// SPI host.
    SpiHost,
    /// Anything else.
    Other,
}

impl Mode {
    pub(super) fn of(control: u32) -> Mode {
        match control >> 2 & 7 {
            1 => Mode::Uart,
            3 => Mode::SpiHost,
            _ => Mode::Other,
        }
    }
}

const UART: Map = Map(&[
    Register::new(CTRLA, Width::Word, 0x7ff3_e19f),
    Register::new(CTRLB, Width::Word, 0x0303_2747),
    Register::new(CTRLC, Width::Word, 0x0f07),
    Register::new(BAUD, Width::Half, 0xffff),
    Register::new(RXPL, Width::Byte, 0xff),
    Register::new(INTENCLR, Width::Byte, 0xbf),
    Register::new(INTENSET, Width::Byte, 0xbf),
    Register::new(INTFLAG, Width::Byte, 0xbf),
    Register::new(STATUS, Width::Half, 0x7f),
    Register::read_only(SYNCBUSY, Width::Word),
    Register::new(DATA, Width::Half, 0x1ff),
    Register::new(DBGCTRL, Width::Byte, 0x01),
]);

const SPI: Map = Map(&[
    Register::new(CTRLA, Width::Word, 0x7f33_019f),
    Register::new(CTRLB, Width::Word, 0x0002_e247),
    Register::new(BAUD, Width::Byte, 0xff),
    Register::new(INTENCLR, Width::Byte, 0x8f),
    Register::new(INTENSET, Width::Byte, 0x8f),
    Register::new(INTFLAG, Width::Byte, 0x8f),
    Register::new(STATUS, Width::Half, 0x04),
    Register::read_only(SYNCBUSY, Width::Word),
    Register::new(ADDR, Width::Word, 0x00ff_00ff),
    Register::new(DATA, Width::Word, 0x1ff),
    Register::new(DBGCTRL, Width::Byte, 0x01),
]);

/// The registers of a mode.
pub(super) fn map(mode: Mode) -> &'static Map {
    match mode {
        Mode::SpiHost => &SPI,
        Mode::Uart | Mode::Other => &UART,
    }
}

impl Sercom {
    /// Ticks of one character; `None` without core clock.
    pub(super) fn character(&self, ctx: &Context) -> Option<u64> {
        let hertz = u128::from(self.core(ctx)?.0.max(1));
        let baud = u128::from(self.baud);
        // Core clock periods per bit as a fraction.
        let (periods, divisor) = match self.mode() {
            Mode::SpiHost => (2 * (baud + 1), 1),
            _ => match self.control >> 13 & 7 {
                0 => (16 << 16, (1 << 16) - baud.min(0xffff)),
                1 => (16 * ((baud & 0x1fff) * 8 + (baud >> 13)), 8),
                2 => (8 << 16, (1 << 16) - baud.min(0xffff)),
                3 => (8 * ((baud & 0x1fff) * 8 + (baud >> 13)), 8),
                _ => (3 << 16, (1 << 16) - baud.min(0xffff)),
            },
        };
        let data_bits = match self.control_b & 7 {
            0 => 8,
            1 => 9,
            bits => u128::from(bits),
        };
        let bits = match self.mode() {
            Mode::SpiHost => data_bits,
            // Start, stop, perhaps a second stop, perhaps parity.
            _ => data_bits + 2 + u128::from(self.control_b >> 6 & 1) + u128::from(self.control >> 24 & 1),
        };
        let ticks = bits * periods * u128::from(Cycles::HZ) / (divisor * hertz);
        Some((ticks as u64).max(1))
    }

    /// What is wrong or missing with the mode that has just been enabled.
    pub(super) fn check_mode(&self, ctx: &mut Context) {
        let form = self.control >> 24 & 15;
        let modelled = match self.mode() {
            Mode::Uart => form <= 1 && self.control >> 28 & 1 == 0 && self.control_b & 0x700 == 0,
            Mode::SpiHost => form == 0 && self.control_b & 7 == 0,
            Mode::Other => false,
        };
        if !modelled {
            ctx.report(Kind::Unmodelled);
        }
        if self.mode() == Mode::Uart && self.control >> 13 & 7 > 4 {
            ctx.report(Kind::ReservedValue);
        }
        for pad in self.pads() {
            if !(Signal::Pad { sercom: self.index, pad }).is_connected(&ctx.wires) {
                ctx.report(Kind::Misuse("a SERCOM is enabled, but no pin is switched to one of its pads"));
            }
        }
    }

    /// Pads in use.
    fn pads(&self) -> Vec<u32> {
        let receive = (self.control >> 20 & 3, self.control_b & B_RXEN != 0);
        let mut pads = match self.mode() {
            Mode::Uart if self.control_b & B_TXEN != 0 => vec![if self.control >> 16 & 3 == 1 { 2 } else { 0 }],
            // Data and clock, by DOPO.
            Mode::SpiHost => [[0, 1], [2, 3], [3, 1], [0, 3]][(self.control >> 16 & 3) as usize].to_vec(),
            _ => vec![],
        };
        if receive.1 && self.mode() != Mode::Other {
            pads.push(receive.0);
        }
        pads
    }

    /// Sends a character over the UART wires.
    pub(super) fn transmit(&self, character: u16, at: Cycles, ctx: &mut Context) {
        // Sent most significant bit first, it arrives reversed at a partner that expects the usual order.
        let byte = if self.control >> 30 & 1 != 0 { character as u8 } else { (character as u8).reverse_bits() };
        if let Serial::Uart(uart) = &mut ctx.wires.serial[self.index] {
            uart.from_chip.push_back(UartByte { at, byte, framing_error: false });
        }
    }

    /// Takes what has arrived over the UART wires.
    pub(super) fn listen(&mut self, ctx: &mut Context) {
        let now = ctx.now;
        loop {
            let byte = match &mut ctx.wires.serial[self.index] {
                Serial::Uart(uart) => uart.to_chip.pop_front_if(|byte| byte.at <= now),
                _ => None,
            };
            let Some(byte) = byte else { break };
            if self.receives() && self.mode() == Mode::Uart {
                let character = if self.control >> 30 & 1 != 0 { byte.byte } else { byte.byte.reverse_bits() };
                self.accept(character, byte.framing_error);
            }
        }
        self.line.listen(&ctx.wires.serial[self.index]);
    }

    /// Exchanges a byte with the SPI device. Nobody selected: the line is pulled high.
    pub(super) fn exchange(&self, character: u16, at: Cycles, ctx: &mut Context) -> u8 {
        let by_hardware = self.control_b >> 13 & 1 != 0;
        let lsb_first = self.control >> 30 & 1 != 0;
        let turn = |byte: u8| if lsb_first { byte.reverse_bits() } else { byte };
        let Serial::Spi(link) = &mut ctx.wires.serial[self.index] else { return 0xff };
        if link.select.is_none() && by_hardware {
            link.set_selected(true, at);
        }
        let answer = if link.selected { turn(link.device.exchange(turn(character as u8), at)) } else { 0xff };
        if link.select.is_none() && by_hardware && !self.line.is_sending() {
            link.set_selected(false, at);
        }
        answer
    }
}
