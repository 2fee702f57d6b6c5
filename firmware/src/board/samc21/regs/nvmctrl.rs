//! NVMCTRL, flash and its read-while-write section (data sheet: "NVMCTRL – Nonvolatile Memory Controller").

use arbitrary_int::{u2, u4, u22};
use bitbybit::{bitenum, bitfield};

pub const NVMCTRL: usize = 0x4100_4000;

/// What goes with every command.
pub const KEY: u8 = 0xa5;

#[bitenum(u7, exhaustive = false)]
#[derive(Debug, PartialEq, Eq)]
pub enum Cmd {
    /// Erase row.
    Er = 0x02,
    /// Write page.
    Wp = 0x04,
    /// Erase a row of the read-while-write section.
    Rwweeer = 0x1a,
    /// Write a page of the read-while-write section.
    Rwweewp = 0x1c,
    /// Clear the page buffer.
    Pbc = 0x44,
    /// Invalidate the cache.
    Invall = 0x46,
}

#[bitenum(u2, exhaustive = false)]
#[derive(Debug, PartialEq, Eq)]
pub enum ReadMode {
    NoMissPenalty = 0,
    LowPower = 1,
    Deterministic = 2,
}

#[bitfield(u16, default = 0, debug)]
pub struct CtrlA {
    #[bits(0..=6, rw)]
    cmd: Option<Cmd>,
    #[bits(8..=15, rw)]
    cmdex: u8,
}

#[bitfield(u32, default = 0x80, debug)]
pub struct CtrlB {
    /// Flash wait states.
    #[bits(1..=4, rw)]
    rws: u4,
    /// Pages are written by command only, not by filling the page buffer.
    #[bit(7, rw)]
    manw: bool,
    #[bits(16..=17, rw)]
    readmode: Option<ReadMode>,
    #[bits(18..=19, rw)]
    cachedis: u2,
}

#[bitfield(u8, default = 0, debug)]
pub struct Interrupts {
    #[bit(0, rw)]
    ready: bool,
    #[bit(1, rw)]
    error: bool,
}

#[bitfield(u16, default = 0, debug)]
pub struct Status {
    #[bit(0, rw)]
    prm: bool,
    #[bit(1, rw)]
    load: bool,
    #[bit(2, rw)]
    proge: bool,
    #[bit(3, rw)]
    locke: bool,
    #[bit(4, rw)]
    nvme: bool,
    #[bit(8, rw)]
    sb: bool,
}

#[bitfield(u32, default = 0, debug)]
pub struct Addr {
    /// In 16-bit words from the start of the address space.
    #[bits(0..=21, rw)]
    addr: u22,
}

#[derive(derive_mmio::Mmio)]
#[repr(C)]
pub struct Nvmctrl {
    ctrla: CtrlA,
    _reserved0: u16,
    ctrlb: CtrlB,
    #[mmio(PureRead)]
    param: u32,
    intenclr: Interrupts,
    _reserved1: [u8; 3],
    intenset: Interrupts,
    _reserved2: [u8; 3],
    #[mmio(PureRead, Write)]
    intflag: Interrupts,
    _reserved3: [u8; 3],
    #[mmio(PureRead, Write)]
    status: Status,
    _reserved4: u16,
    addr: Addr,
    lock: u16,
    _reserved5: u16,
}

agrees_with_facts! {
    nvmctrl_agrees_with_the_facts: Nvmctrl is "NVMCTRL" {
        ctrla: CtrlA, ctrlb: CtrlB, param: u32, intenclr: Interrupts, intenset: Interrupts, intflag: Interrupts,
        status: Status, addr: Addr, lock: u16,
    } _reserved0 _reserved1 _reserved2 _reserved3 _reserved4 _reserved5
}
