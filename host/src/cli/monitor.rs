//! `sarah monitor`.

use clap::Args;

use super::CliError;
use crate::link::live::Role;
use crate::link::port::Target;
use crate::monitor;

#[derive(Args, Debug)]
pub(super) struct MonitorArgs {
    /// The robot: serial:PATH, or serial for the only board.
    #[arg(long, value_name = "serial:PATH", default_value = "serial")]
    link: Target,
    /// Only watch: claim nothing, arm nothing. The emergency stop works even so.
    #[arg(long)]
    observe: bool,
}

/// Does what the arguments say.
pub(super) fn run(args: &MonitorArgs) -> Result<(), CliError> {
    let role = if args.observe { Role::Observer } else { Role::Writer };
    Ok(monitor::run(&args.link, role)?)
}
