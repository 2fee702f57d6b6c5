//! TCC, timer/counter for control (data sheet: "TCC – Timer/Counter for Control Applications").

use bitbybit::{bitenum, bitfield};

pub const TCC0: usize = 0x4200_2400;

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
pub enum Wavegen {
    Nfrq = 0,
    Mfrq = 1,
    /// Single slope: high from 0 until the counter reaches CC.
    Npwm = 2,
}

#[bitfield(u32, default = 0, debug)]
pub struct CtrlA {
    #[bit(0, rw)]
    swrst: bool,
    #[bit(1, rw)]
    enable: bool,
    #[bits(8..=10, rw)]
    prescaler: Prescaler,
}

#[bitfield(u32, default = 0, debug)]
pub struct SyncBusy {
    #[bit(0, rw)]
    swrst: bool,
    #[bit(1, rw)]
    enable: bool,
    #[bit(6, rw)]
    wave: bool,
    #[bit(7, rw)]
    per: bool,
    #[bit(8, rw)]
    cc0: bool,
    #[bit(9, rw)]
    cc1: bool,
    #[bit(10, rw)]
    cc2: bool,
    #[bit(11, rw)]
    cc3: bool,
}

/// What the outputs do on a non-recoverable fault: driven (NRE) to a level (NRV).
#[bitfield(u32, default = 0, debug)]
pub struct DrvCtrl {
    #[bit(0, rw)]
    nre0: bool,
    #[bit(1, rw)]
    nre1: bool,
    #[bit(2, rw)]
    nre2: bool,
    #[bit(3, rw)]
    nre3: bool,
    #[bit(4, rw)]
    nre4: bool,
    #[bit(5, rw)]
    nre5: bool,
    #[bit(6, rw)]
    nre6: bool,
    #[bit(7, rw)]
    nre7: bool,
    #[bit(8, rw)]
    nrv0: bool,
    #[bit(9, rw)]
    nrv1: bool,
    #[bit(14, rw)]
    nrv6: bool,
    #[bit(15, rw)]
    nrv7: bool,
}

#[bitfield(u8, default = 0, debug)]
pub struct DbgCtrl {
    #[bit(0, rw)]
    dbgrun: bool,
    /// A halt by the debugger is a non-recoverable fault.
    #[bit(2, rw)]
    fddbd: bool,
}

#[bitfield(u32, default = 0, debug)]
pub struct Wave {
    #[bits(0..=2, rw)]
    wavegen: Option<Wavegen>,
}

#[derive(derive_mmio::Mmio)]
#[repr(C)]
pub struct Tcc {
    ctrla: CtrlA,
    ctrlbclr: u8,
    ctrlbset: u8,
    _reserved0: u16,
    #[mmio(PureRead)]
    syncbusy: SyncBusy,
    fctrla: u32,
    fctrlb: u32,
    wexctrl: u32,
    drvctrl: DrvCtrl,
    _reserved1: u16,
    dbgctrl: DbgCtrl,
    _reserved2: u8,
    evctrl: u32,
    intenclr: u32,
    intenset: u32,
    #[mmio(PureRead, Write)]
    intflag: u32,
    #[mmio(PureRead, Write)]
    status: u32,
    #[mmio(PureRead, Write)]
    count: u32,
    patt: u16,
    _reserved3: u16,
    wave: Wave,
    per: u32,
    cc: [u32; 4],
    _reserved4: [u32; 4],
    pattbuf: u16,
    _reserved5: [u16; 3],
    perbuf: u32,
    /// Taken over by CC at the end of a period.
    ccbuf: [u32; 4],
}

agrees_with_facts! {
    tcc_agrees_with_the_facts: Tcc is "TCC" {
        ctrla: CtrlA, ctrlbclr: u8, ctrlbset: u8, syncbusy: SyncBusy, fctrla: u32, fctrlb: u32, wexctrl: u32,
        drvctrl: DrvCtrl, dbgctrl: DbgCtrl, evctrl: u32, intenclr: u32, intenset: u32, intflag: u32, status: u32,
        count: u32, patt: u16, wave: Wave, per: u32, cc: [u32; 4], pattbuf: u16, perbuf: u32, ccbuf: [u32; 4],
    } _reserved0 _reserved1 _reserved2 _reserved3 _reserved4 _reserved5
}
