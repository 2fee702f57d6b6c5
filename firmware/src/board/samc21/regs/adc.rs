//! ADC, analogue-to-digital converter (data sheet: "ADC – Analog-to-Digital Converter").

use arbitrary_int::{u3, u5, u6};
use bitbybit::{bitenum, bitfield};

pub const ADC0: usize = 0x4200_4400;

#[bitenum(u3, exhaustive = true)]
#[derive(Debug, PartialEq, Eq)]
pub enum Prescaler {
    Div2 = 0,
    Div4 = 1,
    Div8 = 2,
    Div16 = 3,
    Div32 = 4,
    Div64 = 5,
    Div128 = 6,
    Div256 = 7,
}

#[bitenum(u4, exhaustive = false)]
#[derive(Debug, PartialEq, Eq)]
pub enum Refsel {
    Intref = 0,
    /// 1/1.6 of the analogue supply.
    Intvcc0 = 1,
    /// Half of the analogue supply.
    Intvcc1 = 2,
    Arefa = 3,
    Dac = 4,
    /// The analogue supply.
    Intvcc2 = 5,
}

#[bitenum(u5, exhaustive = false)]
#[derive(Debug, PartialEq, Eq)]
pub enum Muxneg {
    Ain0 = 0,
    Gnd = 24,
}

#[bitfield(u8, default = 0, debug)]
pub struct CtrlA {
    #[bit(0, rw)]
    swrst: bool,
    #[bit(1, rw)]
    enable: bool,
    #[bit(7, rw)]
    ondemand: bool,
}

#[bitfield(u8, default = 0, debug)]
pub struct CtrlB {
    #[bits(0..=2, rw)]
    prescaler: Prescaler,
}

#[bitfield(u8, default = 0, debug)]
pub struct RefCtrl {
    #[bits(0..=3, rw)]
    refsel: Option<Refsel>,
}

#[bitfield(u8, default = 0, debug)]
pub struct Interrupts {
    #[bit(0, rw)]
    resrdy: bool,
    #[bit(1, rw)]
    overrun: bool,
}

#[bitfield(u8, default = 0, debug)]
pub struct SeqStatus {
    #[bits(0..=4, rw)]
    seqstate: u5,
    #[bit(7, rw)]
    seqbusy: bool,
}

#[bitfield(u16, default = 0, debug)]
pub struct InputCtrl {
    #[bits(0..=4, rw)]
    muxpos: u5,
    #[bits(8..=12, rw)]
    muxneg: Option<Muxneg>,
}

#[bitenum(u2, exhaustive = true)]
#[derive(Debug, PartialEq, Eq)]
pub enum Ressel {
    Bit12 = 0,
    Bit16 = 1,
    Bit10 = 2,
    Bit8 = 3,
}

#[bitfield(u16, default = 0, debug)]
pub struct CtrlC {
    #[bit(0, rw)]
    diffmode: bool,
    #[bit(2, rw)]
    freerun: bool,
    #[bits(4..=5, rw)]
    ressel: Ressel,
}

#[bitfield(u8, default = 0, debug)]
pub struct SampCtrl {
    #[bits(0..=5, rw)]
    samplen: u6,
    #[bit(7, rw)]
    offcomp: bool,
}

#[bitfield(u8, default = 0, debug)]
pub struct SwTrig {
    #[bit(0, rw)]
    flush: bool,
    #[bit(1, rw)]
    start: bool,
}

#[bitfield(u16, default = 0, debug)]
pub struct SyncBusy {
    #[bit(0, rw)]
    swrst: bool,
    #[bit(1, rw)]
    enable: bool,
    #[bit(2, rw)]
    inputctrl: bool,
    #[bit(3, rw)]
    ctrlc: bool,
    #[bit(5, rw)]
    sampctrl: bool,
    #[bit(10, rw)]
    swtrig: bool,
}

#[bitfield(u16, default = 0, debug)]
pub struct Calib {
    #[bits(0..=2, rw)]
    biascomp: u3,
    #[bits(8..=10, rw)]
    biasrefbuf: u3,
}

#[derive(derive_mmio::Mmio)]
#[repr(C)]
pub struct Adc {
    ctrla: CtrlA,
    ctrlb: CtrlB,
    refctrl: RefCtrl,
    evctrl: u8,
    intenclr: Interrupts,
    intenset: Interrupts,
    #[mmio(PureRead, Write)]
    intflag: Interrupts,
    #[mmio(PureRead)]
    seqstatus: SeqStatus,
    inputctrl: InputCtrl,
    ctrlc: CtrlC,
    avgctrl: u8,
    sampctrl: SampCtrl,
    winlt: u16,
    winut: u16,
    gaincorr: u16,
    offsetcorr: u16,
    _reserved0: u16,
    swtrig: SwTrig,
    _reserved1: [u8; 3],
    dbgctrl: u8,
    _reserved2: [u8; 3],
    #[mmio(PureRead)]
    syncbusy: SyncBusy,
    _reserved3: u16,
    /// Reading it clears RESRDY.
    #[mmio(Read)]
    result: u16,
    _reserved4: u16,
    /// Inputs converted one after the other by one start, lowest first.
    seqctrl: u32,
    calib: Calib,
    _reserved5: u16,
}

agrees_with_facts! {
    adc_agrees_with_the_facts: Adc is "ADC" {
        ctrla: CtrlA, ctrlb: CtrlB, refctrl: RefCtrl, evctrl: u8, intenclr: Interrupts, intenset: Interrupts,
        intflag: Interrupts, seqstatus: SeqStatus, inputctrl: InputCtrl, ctrlc: CtrlC, avgctrl: u8,
        sampctrl: SampCtrl, winlt: u16, winut: u16, gaincorr: u16, offsetcorr: u16, swtrig: SwTrig, dbgctrl: u8,
        syncbusy: SyncBusy, result: u16, seqctrl: u32, calib: Calib,
    } _reserved0 _reserved1 _reserved2 _reserved3 _reserved4 _reserved5
}
