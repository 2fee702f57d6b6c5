//! A cycle-counting ATSAMC21J18A.
//!
//! Runs the ELF that is flashed onto the robot: a Cortex-M0+ with its exceptions and timing, memories, and the
//! peripherals the firmware uses. Register models check what silicon would not forgive (an access without clock, a write
//! during synchronisation, reserved bits) and report each with its function and time, see [`violation`].
//!
//! ```text
//! Machine ── several chips on one clock, an Exchange (CAN bus, robot) between slices
//!  └─ Chip
//!      ├─ Cpu ──────── instructions, NVIC, SysTick
//!      ├─ Peripherals ─ one field per model, chosen by address
//!      └─ Context ───── what models share: time, SRAM, NVM, interrupt lines, clocks, Wires to the outside
//! ```
//!
//! Time is counted in [`Cycles`] of 48 MHz. A sleeping chip jumps to its next event.

pub mod can_bus;
pub mod chip;
pub mod clocks;
mod code;
pub mod context;
pub mod cpu;
pub mod dma_trigger;
pub mod image;
pub mod imu;
pub mod irq;
pub mod machine;
pub mod nvm;
pub mod peripherals;
pub mod pins;
pub mod profile;
pub mod reset;
pub mod sram;
pub mod symbols;
pub mod time;
pub mod unit;
pub mod violation;
pub mod width;
pub mod wires;

pub use can_bus::CanBus;
pub use chip::{Chip, Stop};
pub use clocks::{Clocks, Hertz};
pub use context::Context;
pub use cpu::Cpu;
pub use dma_trigger::DmaTrigger;
pub use image::{Image, ImageError};
pub use imu::ImuDevice;
pub use irq::Irq;
pub use machine::{Exchange, Machine};
pub use peripherals::{Model, Peripherals};
pub use profile::Profile;
pub use reset::Reset;
pub use time::Cycles;
pub use unit::Unit;
pub use violation::{Kind, Violation};
pub use width::Width;
pub use wires::Wires;
