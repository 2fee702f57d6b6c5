//! RSTC, why the chip started, and WDT, the watchdog (data sheet: "RSTC – Reset Controller", "WDT – Watchdog Timer").

use bitbybit::{bitenum, bitfield};

pub const RSTC: usize = 0x4000_0c00;
pub const WDT: usize = 0x4000_2000;

#[bitfield(u8, default = 0, debug)]
pub struct Rcause {
    #[bit(0, rw)]
    por: bool,
    #[bit(1, rw)]
    bodcore: bool,
    #[bit(2, rw)]
    bodvdd: bool,
    #[bit(4, rw)]
    ext: bool,
    #[bit(5, rw)]
    wdt: bool,
    #[bit(6, rw)]
    syst: bool,
}

#[derive(derive_mmio::Mmio)]
#[repr(C)]
pub struct Rstc {
    #[mmio(PureRead)]
    rcause: Rcause,
}

agrees_with_facts! {
    rstc_agrees_with_the_facts: Rstc is "RSTC" { rcause: Rcause }
}

/// Cycles of its 1.024 kHz clock.
#[bitenum(u4, exhaustive = false)]
#[derive(Debug, PartialEq, Eq)]
pub enum Cycles {
    Cyc8 = 0,
    Cyc16 = 1,
    Cyc32 = 2,
    Cyc64 = 3,
    Cyc128 = 4,
    Cyc256 = 5,
    Cyc512 = 6,
    Cyc1024 = 7,
    Cyc2048 = 8,
    Cyc4096 = 9,
    Cyc8192 = 10,
    Cyc16384 = 11,
}

#[bitfield(u8, default = 0, debug)]
pub struct WdtCtrlA {
    #[bit(1, rw)]
    enable: bool,
    #[bit(2, rw)]
    wen: bool,
    #[bit(7, rw)]
    alwayson: bool,
}

#[bitfield(u8, default = 0, debug)]
pub struct WdtConfig {
    #[bits(0..=3, rw)]
    per: Option<Cycles>,
    #[bits(4..=7, rw)]
    window: Option<Cycles>,
}

#[bitfield(u32, default = 0, debug)]
pub struct WdtSyncBusy {
    #[bit(1, rw)]
    enable: bool,
    #[bit(2, rw)]
    wen: bool,
    #[bit(3, rw)]
    alwayson: bool,
    #[bit(4, rw)]
    clear: bool,
}

/// What feeds the watchdog; anything else resets.
pub const WDT_KEY: u8 = 0xa5;

#[derive(derive_mmio::Mmio)]
#[repr(C)]
pub struct Wdt {
    ctrla: WdtCtrlA,
    config: WdtConfig,
    ewctrl: u8,
    _reserved0: u8,
    intenclr: u8,
    intenset: u8,
    intflag: u8,
    _reserved1: u8,
    #[mmio(PureRead)]
    syncbusy: WdtSyncBusy,
    #[mmio(Write)]
    clear: u8,
    _reserved2: [u8; 3],
}

agrees_with_facts! {
    wdt_agrees_with_the_facts: Wdt is "WDT" {
        ctrla: WdtCtrlA, config: WdtConfig, ewctrl: u8, intenclr: u8, intenset: u8, intflag: u8,
        syncbusy: WdtSyncBusy, clear: u8,
    } _reserved0 _reserved1 _reserved2
}
