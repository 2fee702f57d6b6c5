//! Where clocks come from and go to (data sheet: "OSCCTRL", "OSC32KCTRL", "GCLK", "MCLK").

use arbitrary_int::{u4, u11, u12};
use bitbybit::{bitenum, bitfield};

pub const GCLK: usize = 0x4000_1c00;
pub const MCLK: usize = 0x4000_0800;
pub const OSCCTRL: usize = 0x4000_1000;
pub const OSC32KCTRL: usize = 0x4000_1400;

#[bitenum(u3, exhaustive = true)]
#[derive(Debug, PartialEq, Eq)]
pub enum Source {
    Xosc = 0,
    Gclkin = 1,
    Gclkgen1 = 2,
    Osculp32k = 3,
    Osc32k = 4,
    Xosc32k = 5,
    Osc48m = 6,
    Dpll96m = 7,
}

#[bitfield(u32, default = 0, debug)]
pub struct GenCtrl {
    #[bits(0..=2, rw)]
    src: Source,
    #[bit(8, rw)]
    genen: bool,
    #[bit(9, rw)]
    idc: bool,
    #[bit(12, rw)]
    divsel: bool,
    #[bit(13, rw)]
    runstdby: bool,
    #[bits(16..=31, rw)]
    div: u16,
}

#[bitfield(u32, default = 0, debug)]
pub struct PchCtrl {
    #[bits(0..=3, rw)]
    gen_: u4,
    #[bit(6, rw)]
    chen: bool,
    #[bit(7, rw)]
    wrtlock: bool,
}

#[bitfield(u32, default = 0, debug)]
pub struct GclkSyncBusy {
    #[bit(0, rw)]
    swrst: bool,
    #[bit(2, rw)]
    genctrl0: bool,
    #[bit(3, rw)]
    genctrl1: bool,
}

#[derive(derive_mmio::Mmio)]
#[repr(C)]
pub struct Gclk {
    ctrla: u8,
    _reserved0: [u8; 3],
    #[mmio(PureRead)]
    syncbusy: GclkSyncBusy,
    _reserved1: [u32; 6],
    genctrl: [GenCtrl; 9],
    _reserved2: [u32; 15],
    pchctrl: [PchCtrl; 46],
}

agrees_with_facts! {
    gclk_agrees_with_the_facts: Gclk is "GCLK" {
        ctrla: u8, syncbusy: GclkSyncBusy, genctrl: [GenCtrl; 9], pchctrl: [PchCtrl; 46],
    } _reserved0 _reserved1 _reserved2
}

#[bitfield(u32, default = 0, debug)]
pub struct AhbMask {
    #[bit(7, rw)]
    dmac: bool,
    #[bit(8, rw)]
    can0: bool,
    #[bit(9, rw)]
    can1: bool,
    #[bit(12, rw)]
    divas: bool,
}

#[bitfield(u32, default = 0, debug)]
pub struct ApbCMask {
    #[bit(0, rw)]
    evsys: bool,
    #[bit(1, rw)]
    sercom0: bool,
    #[bit(2, rw)]
    sercom1: bool,
    #[bit(3, rw)]
    sercom2: bool,
    #[bit(4, rw)]
    sercom3: bool,
    #[bit(5, rw)]
    sercom4: bool,
    #[bit(6, rw)]
    sercom5: bool,
    #[bit(9, rw)]
    tcc0: bool,
    #[bit(12, rw)]
    tc0: bool,
    #[bit(13, rw)]
    tc1: bool,
    #[bit(14, rw)]
    tc2: bool,
    #[bit(15, rw)]
    tc3: bool,
    #[bit(16, rw)]
    tc4: bool,
    #[bit(17, rw)]
    adc0: bool,
    #[bit(18, rw)]
    adc1: bool,
}

#[derive(derive_mmio::Mmio)]
#[repr(C)]
pub struct Mclk {
    _reserved0: u8,
    intenclr: u8,
    intenset: u8,
    intflag: u8,
    cpudiv: u8,
    _reserved1: [u8; 11],
    ahbmask: AhbMask,
    apbamask: u32,
    apbbmask: u32,
    apbcmask: ApbCMask,
}

agrees_with_facts! {
    mclk_agrees_with_the_facts: Mclk is "MCLK" {
        intenclr: u8, intenset: u8, intflag: u8, cpudiv: u8, ahbmask: AhbMask, apbamask: u32, apbbmask: u32,
        apbcmask: ApbCMask,
    } _reserved0 _reserved1
}

#[bitenum(u2, exhaustive = false)]
#[derive(Debug, PartialEq, Eq)]
pub enum RefClk {
    Xosc32k = 0,
    Xosc = 1,
    Gclk = 2,
}

#[bitenum(u2, exhaustive = true)]
#[derive(Debug, PartialEq, Eq)]
pub enum Filter {
    Default = 0,
    Lbfilt = 1,
    Hbfilt = 2,
    Hdfilt = 3,
}

#[bitfield(u32, default = 0, debug)]
pub struct OscStatus {
    #[bit(0, rw)]
    xoscrdy: bool,
    #[bit(4, rw)]
    osc48mrdy: bool,
    #[bit(8, rw)]
    dplllckr: bool,
    #[bit(9, rw)]
    dplllckf: bool,
}

#[bitfield(u8, default = 0, debug)]
pub struct Osc48mCtrl {
    #[bit(1, rw)]
    enable: bool,
    #[bit(6, rw)]
    runstdby: bool,
    #[bit(7, rw)]
    ondemand: bool,
}

#[bitfield(u8, default = 0, debug)]
pub struct Osc48mDiv {
    /// Divides by one more.
    #[bits(0..=3, rw)]
    div: u4,
}

#[bitfield(u32, default = 0, debug)]
pub struct Osc48mSyncBusy {
    #[bit(2, rw)]
    osc48mdiv: bool,
}

#[bitfield(u8, default = 0, debug)]
pub struct DpllCtrlA {
    #[bit(1, rw)]
    enable: bool,
    #[bit(6, rw)]
    runstdby: bool,
    #[bit(7, rw)]
    ondemand: bool,
}

/// Output = reference · (LDR + 1 + LDRFRAC/16).
#[bitfield(u32, default = 0, debug)]
pub struct DpllRatio {
    #[bits(0..=11, rw)]
    ldr: u12,
    #[bits(16..=19, rw)]
    ldrfrac: u4,
}

#[bitfield(u32, default = 0, debug)]
pub struct DpllCtrlB {
    #[bits(0..=1, rw)]
    filter: Filter,
    #[bit(2, rw)]
    lpen: bool,
    #[bit(3, rw)]
    wuf: bool,
    #[bits(4..=5, rw)]
    refclk: Option<RefClk>,
    #[bit(12, rw)]
    lbypass: bool,
    #[bits(16..=26, rw)]
    div: u11,
}

#[bitfield(u8, default = 0, debug)]
pub struct DpllSyncBusy {
    #[bit(1, rw)]
    enable: bool,
    #[bit(2, rw)]
    dpllratio: bool,
    #[bit(3, rw)]
    dpllpresc: bool,
}

#[bitfield(u8, default = 0, debug)]
pub struct DpllStatus {
    #[bit(0, rw)]
    lock: bool,
    #[bit(1, rw)]
    clkrdy: bool,
}

#[derive(derive_mmio::Mmio)]
#[repr(C)]
pub struct Oscctrl {
    intenclr: u32,
    intenset: u32,
    intflag: u32,
    #[mmio(PureRead)]
    status: OscStatus,
    xoscctrl: u16,
    cfdpresc: u8,
    evctrl: u8,
    osc48mctrl: Osc48mCtrl,
    osc48mdiv: Osc48mDiv,
    osc48mstup: u8,
    _reserved0: u8,
    #[mmio(PureRead)]
    osc48msyncbusy: Osc48mSyncBusy,
    dpllctrla: DpllCtrlA,
    _reserved1: [u8; 3],
    dpllratio: DpllRatio,
    dpllctrlb: DpllCtrlB,
    dpllpresc: u8,
    _reserved2: [u8; 3],
    #[mmio(PureRead)]
    dpllsyncbusy: DpllSyncBusy,
    _reserved3: [u8; 3],
    #[mmio(PureRead)]
    dpllstatus: DpllStatus,
    _reserved4: [u8; 7],
    cal48m: u32,
}

agrees_with_facts! {
    oscctrl_agrees_with_the_facts: Oscctrl is "OSCCTRL" {
        intenclr: u32, intenset: u32, intflag: u32, status: OscStatus, xoscctrl: u16, cfdpresc: u8, evctrl: u8,
        osc48mctrl: Osc48mCtrl, osc48mdiv: Osc48mDiv, osc48mstup: u8, osc48msyncbusy: Osc48mSyncBusy,
        dpllctrla: DpllCtrlA, dpllratio: DpllRatio, dpllctrlb: DpllCtrlB, dpllpresc: u8, dpllsyncbusy: DpllSyncBusy,
        dpllstatus: DpllStatus, cal48m: u32,
    } _reserved0 _reserved1 _reserved2 _reserved3 _reserved4
}

#[bitenum(u3, exhaustive = true)]
#[derive(Debug, PartialEq, Eq)]
pub enum Startup {
    Cycle1 = 0,
    Cycle32 = 1,
    Cycle2048 = 2,
    Cycle4096 = 3,
    Cycle16384 = 4,
    Cycle32768 = 5,
    Cycle65536 = 6,
    Cycle131072 = 7,
}

#[bitfield(u32, default = 0, debug)]
pub struct Osc32kStatus {
    #[bit(0, rw)]
    xosc32krdy: bool,
    #[bit(2, rw)]
    clkfail: bool,
}

#[bitfield(u16, default = 0, debug)]
pub struct Xosc32k {
    #[bit(1, rw)]
    enable: bool,
    #[bit(2, rw)]
    xtalen: bool,
    #[bit(3, rw)]
    en32k: bool,
    #[bit(4, rw)]
    en1k: bool,
    #[bit(6, rw)]
    runstdby: bool,
    #[bit(7, rw)]
    ondemand: bool,
    #[bits(8..=10, rw)]
    startup: Startup,
    #[bit(12, rw)]
    wrtlock: bool,
}

#[derive(derive_mmio::Mmio)]
#[repr(C)]
pub struct Osc32kctrl {
    intenclr: u32,
    intenset: u32,
    intflag: u32,
    #[mmio(PureRead)]
    status: Osc32kStatus,
    rtcctrl: u32,
    xosc32k: Xosc32k,
    cfdctrl: u8,
    evctrl: u8,
    osc32k: u32,
    osculp32k: u32,
}

agrees_with_facts! {
    osc32kctrl_agrees_with_the_facts: Osc32kctrl is "OSC32KCTRL" {
        intenclr: u32, intenset: u32, intflag: u32, status: Osc32kStatus, rtcctrl: u32, xosc32k: Xosc32k,
        cfdctrl: u8, evctrl: u8, osc32k: u32, osculp32k: u32,
    }
}
