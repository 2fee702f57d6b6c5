//! Host.
pub mod enaf;
pub mod metrics;
pub mod run;
pub mod stats;
pub mod link;
pub mod task;
pub mod figures;
pub mod report;
