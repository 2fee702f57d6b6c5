//! The `sarah` command.

use std::io::Write;
use std::process::ExitCode;

fn main() -> ExitCode {
    match sarah::cli::main() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // Where the terminal is closed there is nobody to tell.
            let _ = writeln!(std::io::stderr(), "sarah: {error}");
            ExitCode::FAILURE
        }
    }
}
