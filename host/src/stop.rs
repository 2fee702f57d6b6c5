//! When somebody wants the process to end: Ctrl-C, the end of a service (SIGTERM), a terminal that is closed (SIGHUP).

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Becomes true when the process is asked to end, which it then has to do by itself. The error says why nobody listens.
pub fn when_asked() -> Result<Arc<AtomicBool>, String> {
    let stop = Arc::new(AtomicBool::new(false));
    let heard = stop.clone();
    ctrlc::set_handler(move || heard.store(true, Ordering::Relaxed)).map_err(|error| error.to_string())?;
    Ok(stop)
}
