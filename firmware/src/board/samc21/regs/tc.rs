//! TC, timer/counter (data sheet: "TC – Timer/Counter"), in its 16- and 32-bit modes. In 32-bit mode an even instance
//! takes the odd one beside it over; both need their bus clock.
//!
//! `INTENCLR`, `INTENSET` and `INTFLAG` act on the bits written as one: write them, never read, modify and write.

use bitbybit::{bitenum, bitfield};

pub const TC0: usize = 0x4200_3000;
pub const TC2: usize = 0x4200_3800;
pub const TC4: usize = 0x4200_4000;

#[bitenum(u2, exhaustive = false)]
#[derive(Debug, PartialEq, Eq)]
pub enum Mode {
    Count16 = 0,
    Count8 = 1,
    Count32 = 2,
}

#[bitenum(u3, exhaustive = true)]
#[derive(Debug, PartialEq, Eq)]
pub enum Prescaler {
    Div1 = 0,
    Div2 = 1,
    Div4 = 2,
    Div8 = 3,
    Div16 = 4,
    Div64 = 5,
    Div256 = 6,
    Div1024 = 7,
}

#[bitenum(u3, exhaustive = false)]
#[derive(Debug, PartialEq, Eq)]
pub enum Cmd {
    None = 0,
    Retrigger = 1,
    Stop = 2,
    Update = 3,
    /// Copies the running counter to where COUNT can be read; the bits read 0 again when it is there.
    ReadSync = 4,
}

#[bitenum(u2, exhaustive = true)]
#[derive(Debug, PartialEq, Eq)]
pub enum Wavegen {
    Nfrq = 0,
    /// CC0 is the top.
    Mfrq = 1,
    Npwm = 2,
    Mpwm = 3,
}

#[bitfield(u32, default = 0, debug)]
pub struct CtrlA {
    #[bit(0, rw)]
    swrst: bool,
    #[bit(1, rw)]
    enable: bool,
    #[bits(2..=3, rw)]
    mode: Option<Mode>,
    #[bit(6, rw)]
    runstdby: bool,
    #[bits(8..=10, rw)]
    prescaler: Prescaler,
}

#[bitfield(u8, default = 0, debug)]
pub struct CtrlB {
    #[bit(0, rw)]
    dir: bool,
    #[bit(2, rw)]
    oneshot: bool,
    #[bits(5..=7, rw)]
    cmd: Option<Cmd>,
}

#[bitfield(u8, default = 0, debug)]
pub struct Interrupts {
    #[bit(0, rw)]
    ovf: bool,
    #[bit(1, rw)]
    err: bool,
    #[bit(4, rw)]
    mc0: bool,
    #[bit(5, rw)]
    mc1: bool,
}

#[bitfield(u8, default = 0, debug)]
pub struct Wave {
    #[bits(0..=1, rw)]
    wavegen: Wavegen,
}

#[bitfield(u8, default = 0, debug)]
pub struct DbgCtrl {
    #[bit(0, rw)]
    dbgrun: bool,
}

#[bitfield(u32, default = 0, debug)]
pub struct SyncBusy {
    #[bit(0, rw)]
    swrst: bool,
    #[bit(1, rw)]
    enable: bool,
    #[bit(2, rw)]
    ctrlb: bool,
    #[bit(4, rw)]
    count: bool,
    #[bit(6, rw)]
    cc0: bool,
    #[bit(7, rw)]
    cc1: bool,
}

#[derive(derive_mmio::Mmio)]
#[repr(C)]
pub struct Tc32 {
    ctrla: CtrlA,
    ctrlbclr: CtrlB,
    #[mmio(PureRead, Write)]
    ctrlbset: CtrlB,
    evctrl: u16,
    intenclr: Interrupts,
    intenset: Interrupts,
    #[mmio(PureRead, Write)]
    intflag: Interrupts,
    status: u8,
    wave: Wave,
    drvctrl: u8,
    _reserved0: u8,
    dbgctrl: DbgCtrl,
    #[mmio(PureRead)]
    syncbusy: SyncBusy,
    #[mmio(PureRead, Write)]
    count: u32,
    _reserved1: u32,
    cc: [u32; 2],
}

agrees_with_facts! {
    tc32_agrees_with_the_facts: Tc32 is "TC_COUNT32" {
        ctrla: CtrlA, ctrlbclr: CtrlB, ctrlbset: CtrlB, evctrl: u16, intenclr: Interrupts, intenset: Interrupts,
        intflag: Interrupts, status: u8, wave: Wave, drvctrl: u8, dbgctrl: DbgCtrl, syncbusy: SyncBusy, count: u32,
        cc: [u32; 2],
    } _reserved0 _reserved1
}

#[derive(derive_mmio::Mmio)]
#[repr(C)]
pub struct Tc16 {
    ctrla: CtrlA,
    ctrlbclr: CtrlB,
    #[mmio(PureRead, Write)]
    ctrlbset: CtrlB,
    evctrl: u16,
    intenclr: Interrupts,
    intenset: Interrupts,
    #[mmio(PureRead, Write)]
    intflag: Interrupts,
    status: u8,
    wave: Wave,
    drvctrl: u8,
    _reserved0: u8,
    dbgctrl: DbgCtrl,
    #[mmio(PureRead)]
    syncbusy: SyncBusy,
    #[mmio(PureRead, Write)]
    count: u16,
    _reserved1: [u16; 3],
    cc: [u16; 2],
}

agrees_with_facts! {
    tc16_agrees_with_the_facts: Tc16 is "TC_COUNT16" {
        ctrla: CtrlA, ctrlbclr: CtrlB, ctrlbset: CtrlB, evctrl: u16, intenclr: Interrupts, intenset: Interrupts,
        intflag: Interrupts, status: u8, wave: Wave, drvctrl: u8, dbgctrl: DbgCtrl, syncbusy: SyncBusy, count: u16,
        cc: [u16; 2],
    } _reserved0 _reserved1
}
