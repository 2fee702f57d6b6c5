//! Figures: plain data in, one SVG out, rasterised to PNG when wanted.
//!
//! Every figure is drawn once, as SVG, in one theme ([`theme`]); the PNG is that same drawing at twice the size. So
//! the two cannot differ, and equal data gives equal bytes on every machine (the font is built in).
//!
//! | function | shows |
//! |---|---|
//! | [`parameters`] | parameters over episodes, seeds and their mean (figure 6 of the paper) |
//! | [`rewards`] | reward over episodes (figure 7) |
//! | [`trunk`], [`imu`] | an episode: trunk, accelerometer and gyro over time (figures 8 and 9) |
//! | [`survival_polar`] | survival by direction of the push |
//! | [`survival_bars`] | survival with its interval, by controller |
//! | [`push_map`] | survival by direction and strength of the push |
//! | [`spreads`], [`intervals`] | where values lie, where estimates are, row by row |
//! | [`filmstrip`] | the robot itself, instant by instant |

mod axes;
mod compare;
mod episode;
mod filmstrip;
mod learning;
mod push_map;
mod raster;
mod robot;
mod rows;
mod svg;
pub mod theme;

pub use compare::{BarRow, PolarSeries, survival_bars, survival_polar};
pub use episode::{Push, imu, trunk};
pub use filmstrip::filmstrip;
pub use learning::{Curve, ParameterCurve, RewardSeries, parameters, rewards};
pub use push_map::{PushMap, push_map};
pub use raster::{Figure, FigureError};
pub use robot::Pose;
pub use rows::{IntervalRow, SpreadRow, intervals, spreads};
