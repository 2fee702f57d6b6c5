//! DMAC, direct memory access (data sheet: "DMAC – Direct Memory Access Controller").
//!
//! `CHID` chooses the channel that the `CH…` registers show: choose and use it in one critical section.

use arbitrary_int::{u4, u5, u6};
use bitbybit::{bitenum, bitfield};

pub const DMAC: usize = 0x4100_6000;

#[bitfield(u16, default = 0, debug)]
pub struct Ctrl {
    #[bit(0, rw)]
    swrst: bool,
    #[bit(1, rw)]
    dmaenable: bool,
    #[bit(8, rw)]
    lvlen0: bool,
    #[bit(9, rw)]
    lvlen1: bool,
    #[bit(10, rw)]
    lvlen2: bool,
    #[bit(11, rw)]
    lvlen3: bool,
}

/// Among channels that want to move at once, the higher level wins.
#[bitenum(u2, exhaustive = true)]
#[derive(Debug, PartialEq, Eq)]
pub enum Lvl {
    Lvl0 = 0,
    Lvl1 = 1,
    Lvl2 = 2,
    Lvl3 = 3,
}

#[bitfield(u32, debug)]
pub struct Active {
    #[bits(8..=12, r)]
    id: u5,
    #[bit(15, r)]
    abusy: bool,
    /// Beats the active channel has left.
    #[bits(16..=31, r)]
    btcnt: u16,
}

#[bitfield(u8, default = 0, debug)]
pub struct ChId {
    #[bits(0..=3, rw)]
    id: u4,
}

#[bitfield(u8, default = 0, debug)]
pub struct ChCtrlA {
    #[bit(0, rw)]
    swrst: bool,
    #[bit(1, rw)]
    enable: bool,
}

#[bitfield(u32, default = 0, debug)]
pub struct ChCtrlB {
    #[bits(5..=6, rw)]
    lvl: Lvl,
    /// One of [`triggers`].
    #[bits(8..=13, rw)]
    trigsrc: u6,
    #[bits(22..=23, rw)]
    trigact: Option<TrigAct>,
}

#[bitenum(u2, exhaustive = false)]
#[derive(Debug, PartialEq, Eq)]
pub enum TrigAct {
    Block = 0,
    /// Each trigger moves one beat.
    Beat = 2,
    Transaction = 3,
}

#[bitfield(u8, default = 0, debug)]
pub struct ChInterrupts {
    #[bit(0, rw)]
    terr: bool,
    #[bit(1, rw)]
    tcmpl: bool,
    #[bit(2, rw)]
    susp: bool,
}

#[bitfield(u8, debug)]
pub struct ChStatus {
    #[bit(0, r)]
    pend: bool,
    #[bit(1, r)]
    busy: bool,
    #[bit(2, r)]
    ferr: bool,
}

#[derive(derive_mmio::Mmio)]
#[repr(C)]
pub struct Dmac {
    ctrl: Ctrl,
    crcctrl: u16,
    crcdatain: u32,
    crcchksum: u32,
    crcstatus: u8,
    dbgctrl: u8,
    qosctrl: u8,
    _reserved0: u8,
    swtrigctrl: u32,
    prictrl0: u32,
    _reserved1: [u32; 2],
    #[mmio(PureRead, Write)]
    intpend: u16,
    _reserved2: u16,
    #[mmio(PureRead)]
    intstatus: u32,
    #[mmio(PureRead)]
    busych: u32,
    #[mmio(PureRead)]
    pendch: u32,
    #[mmio(PureRead)]
    active: Active,
    /// Address of the first descriptors of all channels, 16-byte aligned.
    baseaddr: u32,
    /// Address of the descriptors as they stand, 16-byte aligned.
    wrbaddr: u32,
    _reserved3: [u8; 3],
    chid: ChId,
    chctrla: ChCtrlA,
    _reserved4: [u8; 3],
    chctrlb: ChCtrlB,
    _reserved5: u32,
    chintenclr: ChInterrupts,
    chintenset: ChInterrupts,
    #[mmio(PureRead, Write)]
    chintflag: ChInterrupts,
    #[mmio(PureRead)]
    chstatus: ChStatus,
}

agrees_with_facts! {
    dmac_agrees_with_the_facts: Dmac is "DMAC" {
        ctrl: Ctrl, crcctrl: u16, crcdatain: u32, crcchksum: u32, crcstatus: u8, dbgctrl: u8, qosctrl: u8,
        swtrigctrl: u32, prictrl0: u32, intpend: u16, intstatus: u32, busych: u32, pendch: u32, active: Active,
        baseaddr: u32, wrbaddr: u32, chid: ChId, chctrla: ChCtrlA, chctrlb: ChCtrlB, chintenclr: ChInterrupts,
        chintenset: ChInterrupts, chintflag: ChInterrupts, chstatus: ChStatus,
    } _reserved0 _reserved1 _reserved2 _reserved3 _reserved4 _reserved5
}

/// Trigger sources.
pub mod triggers {
    use arbitrary_int::u6;

    pub const SERCOM1_RX: u6 = u6::new(4);
    pub const SERCOM1_TX: u6 = u6::new(5);
    pub const SERCOM4_RX: u6 = u6::new(10);
    pub const SERCOM4_TX: u6 = u6::new(11);
    pub const ADC0_RESRDY: u6 = u6::new(42);
}

#[cfg(test)]
#[test]
fn every_trigger_is_the_facts() {
    let ours = [
        ("SERCOM1_RX", triggers::SERCOM1_RX),
        ("SERCOM1_TX", triggers::SERCOM1_TX),
        ("SERCOM4_RX", triggers::SERCOM4_RX),
        ("SERCOM4_TX", triggers::SERCOM4_TX),
        ("ADC0_RESRDY", triggers::ADC0_RESRDY),
    ];
    for (name, trigger) in ours {
        assert_eq!(super::facts::number("dma_triggers", name), i64::from(trigger.value()), "{name}");
    }
}
