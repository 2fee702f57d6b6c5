//! LPG1: its cycle, what it makes of a fall, and how it brings its legs back to rest.

mod cycle;
mod fall;
mod late;
mod recovery;
mod rig;
mod stand;
