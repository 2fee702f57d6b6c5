//! ATSAMC21J18A on a SAM C21 Xplained Pro.
//!
//! - [`regs`]: the registers, checked against `facts.toml`. [`vectors`]: interrupt lines and who preempts whom.
//! - [`clocks`]: 48 MHz. [`pins`]: pin functions. [`wiring`]: what is connected where, and which image is which node.
//! - `time_driver`: the clock of slow tasks. `tick`, `executor`: the control tick and who runs at it.
//! - `adc`, `outputs`, [`divider`], `dma`, `can`: what the control and bus tasks use.
//! - [`boot`], `fault`: why it started, why it stopped. [`vitals`], `watchdog`: whether everything lives.
//! - [`queue`]: between the control task and the bus task.
//! - `uart`, `spi`, `nvm`: host link, IMU bus, stored parameters of the coordinator.
//! - `node`: the three node images. `coordinator`: the fourth.
//!
//! What touches the chip is built for the chip only; everything linked above is tested on the host.
//! **Built, never run on silicon yet**; what no source at hand confirms is marked UNVERIFIED.

pub mod boot;
pub mod clocks;
pub mod divider;
pub mod pins;
pub mod queue;
pub mod regs;
pub mod vectors;
pub mod vitals;
pub mod wiring;

#[cfg(target_os = "none")]
pub mod adc;
#[cfg(target_os = "none")]
pub mod can;
#[cfg(target_os = "none")]
pub mod coordinator;
#[cfg(target_os = "none")]
pub mod dma;
#[cfg(target_os = "none")]
pub mod executor;
#[cfg(target_os = "none")]
pub mod fault;
#[cfg(target_os = "none")]
pub mod log;
#[cfg(target_os = "none")]
pub mod node;
#[cfg(target_os = "none")]
pub mod nvm;
#[cfg(target_os = "none")]
pub mod outputs;
#[cfg(target_os = "none")]
pub mod spi;
#[cfg(target_os = "none")]
pub mod tick;
#[cfg(target_os = "none")]
pub mod time_driver;
#[cfg(target_os = "none")]
pub mod uart;
#[cfg(target_os = "none")]
pub mod watchdog;
