//! Statistics for claims about few, noisy, expensive episodes.
//!
//! Everything is a pure function of its input; what draws random numbers takes a seed. Inputs are finite numbers:
//! what is not (a solver blow-up) is counted by the caller, never averaged in. Empty input gives `None`.

mod bootstrap;
mod order;
mod proportion;

pub use bootstrap::{
    BootstrapError, Interval, RESAMPLES, Statistic, bootstrap, bootstrap_crossed, improvement, paired_difference,
};
pub use order::{iqm, mean, median, percentile, probability_of_improvement};
pub use proportion::{Proportion, wilson};
