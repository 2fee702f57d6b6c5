//! A run is one folder: everything it needs or makes lies inside it.
//!
//! ```text
//! DIR/
//!   config.toml        the resolved configuration, as used
//!   run.json           revision, version, seeds, command line; its presence means "this run has begun"
//!   <method>/seed-<s>/session-<n>/metrics.csv      one row per episode, append-only
//!   <method>/seed-<s>/session-<n>/checkpoint.bin   everything needed to go on, and how long metrics.csv was
//!   evaluated/         results of evaluations, kept so that a resumed run need not repeat them
//!   tensorboard/       event files, derived from the metrics
//!   params.toml        the trained parameter set
//!   evaluation.json    the numbers behind the report
//!   figures/  report.md
//! ```
//!
//! Two promises. A file is either its old or its new self, never half-written ([`write_atomic`]). A run that was
//! killed and resumed ends bit-identical to one that was not: the metrics are cut back to the length recorded in
//! the checkpoint, then grow on ([`MetricsCsv`]).

mod atomic;
mod error;
mod folder;
mod info;
mod metrics_csv;
mod param_set;
mod params;
mod tensorboard;

pub use atomic::{read_bytes, read_text, write_atomic};
pub use error::RunError;
pub use folder::{Layout, RunFolder};
pub use info::{FORMAT, Revision, RunInfo, utc_now};
pub use metrics_csv::{MetricsCsv, MetricsTable, read_metrics};
pub use param_set::{ParamFileError, load_param_set, param_set_text, param_specs};
pub use params::{Origin, ParamSpec, ParamsError, read_params, write_params};
pub use tensorboard::{EVENTS_FILE, event_file};
