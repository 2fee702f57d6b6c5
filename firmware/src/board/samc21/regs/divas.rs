//! DIVAS, the divider (data sheet: "DIVAS – Divide and Square Root Accelerator"). On the single-cycle I/O bus.

use bitbybit::bitfield;

/// Base on the I/O bus: one cycle an access.
pub const DIVAS_IOBUS: usize = 0x6000_0200;

#[bitfield(u8, default = 0, debug)]
pub struct CtrlA {
    #[bit(0, rw)]
    signed: bool,
    /// Disable leading-zero optimisation: constant time instead of early out.
    #[bit(1, rw)]
    dlz: bool,
}

#[bitfield(u8, default = 0, debug)]
pub struct Status {
    #[bit(0, rw)]
    busy: bool,
    #[bit(1, rw)]
    dbz: bool,
}

#[derive(derive_mmio::Mmio)]
#[repr(C)]
pub struct Divas {
    ctrla: CtrlA,
    _reserved0: [u8; 3],
    #[mmio(PureRead, Write)]
    status: Status,
    _reserved1: [u8; 3],
    dividend: u32,
    /// Writing it starts the division.
    divisor: u32,
    #[mmio(PureRead)]
    result: u32,
    #[mmio(PureRead)]
    rem: u32,
    sqrnum: u32,
}

agrees_with_facts! {
    divas_agrees_with_the_facts: Divas is "DIVAS" {
        ctrla: CtrlA, status: Status, dividend: u32, divisor: u32, result: u32, rem: u32, sqrnum: u32,
    } _reserved0 _reserved1
}
