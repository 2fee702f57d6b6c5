//! The `sarah` command as its users meet it: a process with arguments, files and an exit code.
//!
//! Runs are compared byte for byte in everything that they computed: `config.toml`, `params.toml`, every
//! `metrics.csv` and `checkpoint.bin`, `evaluated/`, `tensorboard/` and `figures/`. Not compared between runs:
//! `run.json`, `evaluation.json` and `report.md`, which say when and by which command line a run began.
//!
//! - `place`: what the tests share. `resume`: kills, locks, full disks. `refusals`: mistakes of the user.
//! - `results`: what a run and an evaluation print. `study`: many of them from one file.

mod place;
mod refusals;
mod results;
mod resume;
mod study;
