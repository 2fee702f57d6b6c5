//! CAN0 (data sheet: "CAN – Control Area Network").
//!
//! | | bit rate | quanta of 48 MHz | sample point |
//! |---|---|---|---|
//! | arbitration | 1 Mbit/s | 48 = 1 + 37 + 10 | 79 % |
//! | data | 2 Mbit/s | 24 = 1 + 17 + 6 | 75 % |

use mcan::config::BitTiming;
use mcan::messageram::SharedMemory;
use mcan_core::fugit::HertzU32;
use mcan_core::{CanId, Dependencies};
use static_cell::ConstStaticCell;

use super::clocks::{self, CPU_HZ, Channel, Generator};
use super::vectors::{self, interrupt, priority};
use super::wiring::CAN;
use crate::board::can::{self, Memory, Port};

pub use crate::board::can::Statistics;

/// Marks the first controller.
pub enum Can0 {}
// SAFETY: the first CAN controller lies there.
unsafe impl CanId for Can0 {
    const ADDRESS: *const () = 0x4200_1c00 as *const ();
}

/// Clocks and pins, set up.
pub struct Ready(());
// SAFETY: made in `Can::start` only, after clocks and pins; the whole RAM is within the controller's reach, and host and
// CAN clock are both generator 0.
unsafe impl Dependencies<Can0> for Ready {
    fn eligible_message_ram_start(&self) -> *const () {
        0x2000_0000 as *const ()
    }
    fn host_clock(&self) -> HertzU32 {
        HertzU32::from_raw(CPU_HZ)
    }
    fn can_clock(&self) -> HertzU32 {
        HertzU32::from_raw(CPU_HZ)
    }
}

impl Port for Can0 {
    type Id = Can0;
    type Ready = Ready;
    type Line = interrupt;
    const LINE: interrupt = interrupt::CAN0;
    const NOMINAL: BitTiming =
        BitTiming { sjw: 10, phase_seg_1: 37, phase_seg_2: 10, bitrate: HertzU32::from_raw(1_000_000) };
    const DATA: BitTiming =
        BitTiming { sjw: 6, phase_seg_1: 17, phase_seg_2: 6, bitrate: HertzU32::from_raw(2_000_000) };
}

const _: () = {
    let nominal = 1 + Can0::NOMINAL.phase_seg_1 as u32 + Can0::NOMINAL.phase_seg_2 as u32;
    let data = 1 + Can0::DATA.phase_seg_1 as u32 + Can0::DATA.phase_seg_2 as u32;
    assert!(nominal * 1_000_000 == CPU_HZ && data * 2_000_000 == CPU_HZ);
};

static MEMORY: ConstStaticCell<SharedMemory<Memory>> = ConstStaticCell::new(SharedMemory::new());

#[cortex_m_rt::interrupt]
fn CAN0() {
    can::on_interrupt(interrupt::CAN0);
}

/// The bus as one task uses it.
pub type Can = can::Can<Can0>;

impl Can {
    /// Joins the bus; hears identifiers within `accepts` (at most 4 ranges). `None` if called twice.
    pub fn start(accepts: &[(u16, u16)]) -> Option<Can> {
        clocks::open_ahb(|ahb| ahb.with_can0(true));
        clocks::feed(Channel::Can0, Generator::Cpu);
        for wire in CAN {
            wire.pin.switch(wire.function);
        }
        let can = Can::join(Ready(()), MEMORY.try_take()?, accepts)?;
        vectors::enable(interrupt::CAN0, priority::IO);
        Some(can)
    }
}
