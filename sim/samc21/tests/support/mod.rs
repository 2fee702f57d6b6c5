//! Helpers of the tests.

pub mod build;
pub mod thumb;
