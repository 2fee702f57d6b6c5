//! CAN1 behind the board's ATA6561 (data sheet: "CAN – Control Area Network"; user guide: "CAN").
//!
//! | | bit rate | quanta of 40 MHz | sample point |
//! |---|---|---|---|
//! | arbitration | 1 Mbit/s | 40 = 1 + 31 + 8 | 80 % |
//! | data | 2 Mbit/s | 20 = 1 + 14 + 5 | 75 % |
//!
//! The transceiver's standby pin is driven low: normal mode. Whether the compensated delay fits this transceiver:
//! UNVERIFIED on silicon.

use atsamd_hal::can::Dependencies;
use atsamd_hal::clock::v2::gclk::Gclk1Id;
use atsamd_hal::clock::v2::types::Can1;
use atsamd_hal::gpio::{AlternateH, PB12, PB13, Pin};
use atsamd_hal::pac::{self, Interrupt, interrupt};
use mcan::config::BitTiming;
use mcan::messageram::SharedMemory;
use mcan_core::fugit::HertzU32;
use static_cell::ConstStaticCell;

use super::{FAST_HZ, enable, priority};
use crate::board::can::{self, Memory, Port};

/// What the HAL vouches for: clocks and pins.
pub type Ready = Dependencies<Can1, Gclk1Id, Pin<PB13, AlternateH>, Pin<PB12, AlternateH>, pac::Can1>;

/// Marks the board's bus.
pub enum Bus {}

impl Port for Bus {
    type Id = Can1;
    type Ready = Ready;
    type Line = Interrupt;
    const LINE: Interrupt = Interrupt::CAN1;
    const NOMINAL: BitTiming =
        BitTiming { sjw: 8, phase_seg_1: 31, phase_seg_2: 8, bitrate: HertzU32::from_raw(1_000_000) };
    const DATA: BitTiming =
        BitTiming { sjw: 5, phase_seg_1: 14, phase_seg_2: 5, bitrate: HertzU32::from_raw(2_000_000) };
}

const _: () = {
    let nominal = 1 + Bus::NOMINAL.phase_seg_1 as u32 + Bus::NOMINAL.phase_seg_2 as u32;
    let data = 1 + Bus::DATA.phase_seg_1 as u32 + Bus::DATA.phase_seg_2 as u32;
    assert!(nominal * 1_000_000 == FAST_HZ && data * 2_000_000 == FAST_HZ);
};

static MEMORY: ConstStaticCell<SharedMemory<Memory>> = ConstStaticCell::new(SharedMemory::new());

#[interrupt]
fn CAN1() {
    can::on_interrupt(Interrupt::CAN1);
}

/// The bus as one task uses it.
pub type Can = can::Can<Bus>;

/// Joins the bus; hears identifiers within `accepts` (at most 4 ranges). `None` if called twice.
pub fn start(ready: Ready, accepts: &[(u16, u16)]) -> Option<Can> {
    let can = Can::join(ready, MEMORY.try_take()?, accepts)?;
    enable(Interrupt::CAN1, priority::IO);
    Some(can)
}
