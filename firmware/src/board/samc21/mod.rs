//! ATSAMC21J18A on a SAM C21 Xplained Pro.
//!
//! - `regs`: the registers, checked against `facts.toml`. `vectors`: interrupt lines and who preempts whom.
//! - `clocks`: 48 MHz. [`pins`]: pin functions. [`wiring`]: what is connected where, and which image is which node.
//! - `time_driver`: the clock of slow tasks. `tick`, `executor`: the control tick and who runs at it.
//! - `adc`, `outputs`, `divider`, `dma`, `can`: what the control and bus tasks use.
//! - `boot`, `fault`: why it started, why it stopped. `vitals`, `watchdog`: whether everything lives.
//! - `queue`: between the control task and the bus task.
//! - `uart`, `spi`, `nvm`: host link, IMU bus, stored parameters of the coordinator.
//! - `node`: the three node images. `coordinator`: the fourth.
//!
//! What touches the chip is built for the chip only; `regs`, `vectors`, `clocks`, `divider`, `boot`, `vitals` and `queue`
//! are tested on the host. [`pins`] and [`wiring`] are plain data, and there for whoever stands in for the robot.
//! **Built, never run on silicon yet**; what no source at hand confirms is marked UNVERIFIED.

#[cfg(any(feature = "samc21", test))]
pub mod boot;
#[cfg(any(feature = "samc21", test))]
pub mod clocks;
#[cfg(any(feature = "samc21", test))]
pub mod divider;
pub mod pins;
#[cfg(any(feature = "samc21", test))]
pub mod queue;
#[cfg(any(feature = "samc21", test))]
pub mod regs;
#[cfg(any(feature = "samc21", test))]
pub mod vectors;
pub mod wiring;

#[cfg(all(feature = "samc21", target_os = "none"))]
pub mod adc;
#[cfg(all(feature = "samc21", target_os = "none"))]
pub mod can;
#[cfg(all(feature = "samc21", target_os = "none"))]
pub mod coordinator;
#[cfg(all(feature = "samc21", target_os = "none"))]
pub mod dma;
#[cfg(all(feature = "samc21", target_os = "none"))]
pub mod executor;
#[cfg(all(feature = "samc21", target_os = "none"))]
pub mod fault;
#[cfg(all(feature = "samc21", target_os = "none"))]
pub mod node;
#[cfg(all(feature = "samc21", target_os = "none"))]
pub mod nvm;
#[cfg(all(feature = "samc21", target_os = "none"))]
pub mod outputs;
#[cfg(all(feature = "samc21", target_os = "none"))]
pub mod spi;
#[cfg(all(feature = "samc21", target_os = "none"))]
pub mod tick;
#[cfg(all(feature = "samc21", target_os = "none"))]
pub mod time_driver;
#[cfg(all(feature = "samc21", target_os = "none"))]
pub mod uart;
#[cfg(all(feature = "samc21", target_os = "none"))]
pub mod watchdog;

#[cfg(all(feature = "samc21", target_os = "none"))]
pub use super::log;
#[cfg(any(feature = "samc21", test))]
pub use super::vitals;
