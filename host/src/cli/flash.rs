//! `sarah flash`.

use std::path::PathBuf;

use clap::Args;

use super::CliError;
use super::link::IMAGES;
use crate::flash::{self, BOARDS_FILE, Boards, FlashError, Job, Node, Tool};

#[derive(Args, Debug)]
#[command(group(clap::ArgGroup::new("what").required(true).args(["node", "all", "elf"])))]
pub(super) struct FlashArgs {
    /// Which image.
    #[arg(long, value_enum)]
    node: Option<Node>,
    /// All four images, each onto its board.
    #[arg(long, conflicts_with_all = ["probe", "run"])]
    all: bool,
    /// This very file.
    #[arg(long)]
    elf: Option<PathBuf>,
    /// Serial number of the board's probe; without it the board map's, or the only board plugged in.
    #[arg(long)]
    probe: Option<String>,
    /// Board map: which probe is which node's.
    #[arg(long, default_value = BOARDS_FILE)]
    boards: PathBuf,
    /// Where the images lie.
    #[arg(long, default_value = IMAGES)]
    images: PathBuf,
    /// What flashes.
    #[arg(long, value_enum, default_value = "openocd")]
    tool: Tool,
    /// Show the image's logs afterwards, until Ctrl-C.
    #[arg(long)]
    run: bool,
    /// Only print the command.
    #[arg(long)]
    dry_run: bool,
}

/// Does what the arguments say.
pub(super) fn run(args: &FlashArgs) -> Result<(), CliError> {
    let nodes = if args.all { Node::ALL.to_vec() } else { args.node.into_iter().collect() };
    let map = if args.all || args.boards.exists() { Some(Boards::load(&args.boards)?) } else { None };
    let mut jobs = vec![];
    for node in &nodes {
        let mapped = map.as_ref().map(|map| map.probe(*node, &args.boards).map(str::to_owned));
        let probe = match args.probe.clone() {
            Some(probe) => Some(probe),
            None => mapped.transpose()?,
        };
        jobs.push((node.name().to_owned(), Job { elf: args.images.join(node.name()), probe }));
    }
    if let Some(elf) = &args.elf {
        let name = elf.file_name().unwrap_or_default().to_string_lossy().into_owned();
        // `cargo run` gives a path and no node: the image is named after its node.
        let node = Node::ALL.into_iter().find(|node| node.name() == name);
        let mapped = map.as_ref().zip(node).and_then(|(map, node)| map.probe(node, &args.boards).ok());
        let probe = args.probe.clone().or(mapped.map(str::to_owned));
        jobs.push((name, Job { elf: elf.clone(), probe }));
    }
    // All are looked at before the first is written.
    let attached = flash::attached();
    let jobs: Vec<_> =
        jobs.into_iter().map(|(name, job)| Ok((name, job.checked(&attached)?))).collect::<Result<_, FlashError>>()?;
    for (name, job) in jobs {
        if args.dry_run {
            let command = if args.run { args.tool.run(&job, 9090) } else { args.tool.flash(&job) };
            println!("{}", flash::typed(&command));
        } else if args.run {
            job.run(args.tool)?;
        } else {
            job.flash(args.tool)?;
            println!("{name}: written and verified");
        }
    }
    Ok(())
}
