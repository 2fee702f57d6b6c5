//! The `sarah` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    match sarah::cli::main() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("sarah: {error}");
            ExitCode::FAILURE
        }
    }
}
