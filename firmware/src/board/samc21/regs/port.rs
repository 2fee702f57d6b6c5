//! PORT, the pins (data sheet: "PORT – I/O Pin Controller"). Groups A and B lie 0x80 apart.

use arbitrary_int::u4;
use bitbybit::bitfield;

/// On the bus.
pub const PORT: usize = 0x4100_0000;
/// The same registers on the single-cycle I/O bus.
pub const PORT_IOBUS: usize = 0x6000_0000;
/// From group to group.
pub const GROUP_STRIDE: usize = 0x80;

#[bitfield(u8, default = 0, debug)]
pub struct Pmux {
    #[bits(0..=3, rw)]
    pmuxe: u4,
    #[bits(4..=7, rw)]
    pmuxo: u4,
}

#[bitfield(u8, default = 0, debug)]
pub struct PinCfg {
    #[bit(0, rw)]
    pmuxen: bool,
    #[bit(1, rw)]
    inen: bool,
    #[bit(2, rw)]
    pullen: bool,
    #[bit(6, rw)]
    drvstr: bool,
}

#[derive(derive_mmio::Mmio)]
#[repr(C)]
pub struct Group {
    dir: u32,
    dirclr: u32,
    dirset: u32,
    dirtgl: u32,
    out: u32,
    outclr: u32,
    outset: u32,
    outtgl: u32,
    #[mmio(PureRead)]
    in_: u32,
    ctrl: u32,
    #[mmio(Write)]
    wrconfig: u32,
    evctrl: u32,
    pmux: [Pmux; 16],
    pincfg: [PinCfg; 32],
}

agrees_with_facts! {
    port_agrees_with_the_facts: Group is "PORT_GROUP" {
        dir: u32, dirclr: u32, dirset: u32, dirtgl: u32, out: u32, outclr: u32, outset: u32, outtgl: u32, in_: u32,
        ctrl: u32, wrconfig: u32, evctrl: u32, pmux: [Pmux; 16], pincfg: [PinCfg; 32],
    }
}
