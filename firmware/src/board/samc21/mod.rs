//! ATSAMC21J18A on a SAM C21 Xplained Pro.
//!
//! - [`regs`]: the registers, checked against `facts.toml`.
pub mod regs;
