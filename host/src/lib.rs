//! Host.
pub mod enaf;
pub mod metrics;
pub mod run;
pub mod stats;
