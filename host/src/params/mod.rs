//! Work with parameter sets: from files, runs, the built-in default, and the three sets of a robot.
//!
//! - [`source`]: where a set comes from. [`assign`]: `P1=0.05` onto a set, or into a file.
//! - [`table`]: sets as people and programs read them.
//! - [`errand`]: reading, changing and keeping a robot's sets over a link.

pub mod assign;
pub mod errand;
pub mod source;
pub mod table;
