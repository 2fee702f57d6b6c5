//! SERCOM, serial communication (data sheet: "SERCOM USART" and "SERCOM SPI"): the two of its six faces that are used.
//!
//! `INTENSET`, `INTENCLR` and `INTFLAG` act on the bits written as one: write them, never read, modify and write.

use arbitrary_int::{u3, u13};
use bitbybit::{bitenum, bitfield};

pub const SERCOM1: usize = 0x4200_0800;
pub const SERCOM4: usize = 0x4200_1400;

#[bitenum(u3, exhaustive = false)]
#[derive(Debug, PartialEq, Eq)]
pub enum Mode {
    UsartIntClk = 1,
    SpiMaster = 3,
}

#[bitenum(u3, exhaustive = false)]
#[derive(Debug, PartialEq, Eq)]
pub enum Sampr {
    XArithmetic16 = 0,
    XFractional16 = 1,
}

/// A pad of the SERCOM.
#[bitenum(u2, exhaustive = true)]
#[derive(Debug, PartialEq, Eq)]
pub enum Pad {
    Pad0 = 0,
    Pad1 = 1,
    Pad2 = 2,
    Pad3 = 3,
}

/// Where a USART sends.
#[bitenum(u2, exhaustive = false)]
#[derive(Debug, PartialEq, Eq)]
pub enum Txpo {
    Pad0 = 0,
    Pad2 = 1,
}

#[bitfield(u32, default = 0, debug)]
pub struct UsartCtrlA {
    #[bit(0, rw)]
    swrst: bool,
    #[bit(1, rw)]
    enable: bool,
    #[bits(2..=4, rw)]
    mode: Option<Mode>,
    #[bits(13..=15, rw)]
    sampr: Option<Sampr>,
    #[bits(16..=17, rw)]
    txpo: Option<Txpo>,
    #[bits(20..=21, rw)]
    rxpo: Pad,
    /// Least significant bit first.
    #[bit(30, rw)]
    dord: bool,
}

#[bitfield(u32, default = 0, debug)]
pub struct UsartCtrlB {
    /// 0 is eight bits.
    #[bits(0..=2, rw)]
    chsize: u3,
    #[bit(16, rw)]
    txen: bool,
    #[bit(17, rw)]
    rxen: bool,
}

/// The rate in the fractional mode: clock / (16 · (BAUD + FP / 8)).
#[bitfield(u16, default = 0, debug)]
pub struct BaudFracMode {
    #[bits(0..=12, rw)]
    baud: u13,
    #[bits(13..=15, rw)]
    fp: u3,
}

#[bitfield(u8, default = 0, debug)]
pub struct UsartInterrupts {
    #[bit(0, rw)]
    dre: bool,
    #[bit(1, rw)]
    txc: bool,
    #[bit(2, rw)]
    rxc: bool,
    #[bit(7, rw)]
    error: bool,
}

#[bitfield(u16, default = 0, debug)]
pub struct UsartStatus {
    #[bit(0, rw)]
    perr: bool,
    #[bit(1, rw)]
    ferr: bool,
    /// A byte came before the last one was fetched.
    #[bit(2, rw)]
    bufovf: bool,
}

#[bitfield(u32, debug)]
pub struct SyncBusy {
    #[bit(0, r)]
    swrst: bool,
    #[bit(1, r)]
    enable: bool,
    #[bit(2, r)]
    ctrlb: bool,
}

/// A SERCOM as a USART that makes its own clock.
#[derive(derive_mmio::Mmio)]
#[repr(C)]
pub struct Usart {
    ctrla: UsartCtrlA,
    ctrlb: UsartCtrlB,
    ctrlc: u32,
    baud_frac_mode: BaudFracMode,
    rxpl: u8,
    _reserved0: [u8; 5],
    intenclr: UsartInterrupts,
    _reserved1: u8,
    intenset: UsartInterrupts,
    _reserved2: u8,
    #[mmio(PureRead, Write)]
    intflag: UsartInterrupts,
    _reserved3: u8,
    #[mmio(PureRead, Write)]
    status: UsartStatus,
    #[mmio(PureRead)]
    syncbusy: SyncBusy,
    _reserved4: [u32; 2],
    #[mmio(Read, Write)]
    data: u16,
    _reserved5: [u8; 6],
    dbgctrl: u8,
    _reserved6: [u8; 3],
}

agrees_with_facts! {
    usart_agrees_with_the_facts: Usart is "SERCOM_USART_INT" {
        ctrla: UsartCtrlA, ctrlb: UsartCtrlB, ctrlc: u32, baud_frac_mode: BaudFracMode, rxpl: u8,
        intenclr: UsartInterrupts, intenset: UsartInterrupts, intflag: UsartInterrupts, status: UsartStatus,
        syncbusy: SyncBusy, data: u16, dbgctrl: u8,
    } _reserved0 _reserved1 _reserved2 _reserved3 _reserved4 _reserved5 _reserved6
}

#[bitfield(u32, default = 0, debug)]
pub struct SpiCtrlA {
    #[bit(0, rw)]
    swrst: bool,
    #[bit(1, rw)]
    enable: bool,
    #[bits(2..=4, rw)]
    mode: Option<Mode>,
    /// Where data and clock go out: [`DOPO_2_3`].
    #[bits(16..=17, rw)]
    dopo: Pad,
    /// Where data comes in.
    #[bits(20..=21, rw)]
    dipo: Pad,
    #[bit(28, rw)]
    cpha: bool,
    #[bit(29, rw)]
    cpol: bool,
}

/// Data out on pad 2, clock on pad 3 (data sheet, CTRLA.DOPO).
pub const DOPO_2_3: Pad = Pad::Pad1;

#[bitfield(u32, default = 0, debug)]
pub struct SpiCtrlB {
    /// 0 is eight bits.
    #[bits(0..=2, rw)]
    chsize: u3,
    #[bit(17, rw)]
    rxen: bool,
}

#[bitfield(u8, default = 0, debug)]
pub struct SpiInterrupts {
    #[bit(0, rw)]
    dre: bool,
    #[bit(1, rw)]
    txc: bool,
    #[bit(2, rw)]
    rxc: bool,
    #[bit(7, rw)]
    error: bool,
}

#[bitfield(u16, default = 0, debug)]
pub struct SpiStatus {
    #[bit(2, rw)]
    bufovf: bool,
}

/// A SERCOM as an SPI master.
#[derive(derive_mmio::Mmio)]
#[repr(C)]
pub struct Spi {
    ctrla: SpiCtrlA,
    ctrlb: SpiCtrlB,
    _reserved0: u32,
    /// The rate: clock / (2 · (BAUD + 1)).
    baud: u8,
    _reserved1: [u8; 7],
    intenclr: SpiInterrupts,
    _reserved2: u8,
    intenset: SpiInterrupts,
    _reserved3: u8,
    #[mmio(PureRead, Write)]
    intflag: SpiInterrupts,
    _reserved4: u8,
    #[mmio(PureRead, Write)]
    status: SpiStatus,
    #[mmio(PureRead)]
    syncbusy: SyncBusy,
    _reserved5: u32,
    addr: u32,
    #[mmio(Read, Write)]
    data: u32,
    _reserved6: u32,
    dbgctrl: u8,
    _reserved7: [u8; 3],
}

agrees_with_facts! {
    spi_agrees_with_the_facts: Spi is "SERCOM_SPIM" {
        ctrla: SpiCtrlA, ctrlb: SpiCtrlB, baud: u8, intenclr: SpiInterrupts, intenset: SpiInterrupts,
        intflag: SpiInterrupts, status: SpiStatus, syncbusy: SyncBusy, addr: u32, data: u32, dbgctrl: u8,
    } _reserved0 _reserved1 _reserved2 _reserved3 _reserved4 _reserved5 _reserved6 _reserved7
}
