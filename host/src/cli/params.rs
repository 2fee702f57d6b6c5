//! `sarah params`: show, get, set, diff, commit and bake.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use sarah_firmware::default_params;
use sarah_protocol::host::Which;
use sarah_protocol::params::{ParamSet, SPECS};

use super::CliError;
use crate::bake::bake;
use crate::link::live::{Link, Role};
use crate::link::port::Target;
use crate::params::assign::{Assignment, assign, place, write_into};
use crate::params::errand::{Errand, RobotError, RobotSets, run as run_errand};
use crate::params::source::{Source, load, name};
use crate::params::table;
use crate::run::load_param_set;

#[derive(Subcommand, Debug)]
pub(super) enum ParamsVerb {
    /// Show a set with units, ranges and meanings; with a robot and no source, its three sets side by side.
    #[command(
        after_help = "Examples:\n  sarah params show                            the set built into the firmware\n  \
        sarah params show runs/train-1\n  \
        sarah params show --link serial:/dev/ttyACM0\n  \
        sarah params show stored --link serial --json"
    )]
    Show(ShowArgs),
    /// Print one value.
    #[command(after_help = "Examples:\n  sarah params get H2 --link serial\n  sarah params get P1 runs/train-1")]
    Get(GetArgs),
    /// Change values of a robot or of a parameter file.
    #[command(after_help = "Examples:\n  sarah params set H2=4.4 H3=0.04 --link serial:/dev/ttyACM0\n  \
        sarah params set --from runs/train-1 --link serial --commit\n  \
        sarah params set --from stored --link serial           back to what is stored\n  \
        sarah params set P1=0.03 --file my-params.toml\n\n\
        Values given together come into force together, at one cycle boundary. What is not committed goes 10 s after \
        the last host has gone.")]
    Set(SetArgs),
    /// Compare two sets.
    #[command(after_help = "Examples:\n  sarah params diff default runs/train-1\n  \
        sarah params diff applied stored --link serial:/dev/ttyACM0")]
    Diff(DiffArgs),
    /// Keep the set in force over power cycles.
    #[command(after_help = "Example:\n  sarah params commit --link serial:/dev/ttyACM0")]
    Commit(CommitArgs),
    /// Make a run's set the one the firmware is built with; takes effect with the next `cargo firmware`.
    #[command(after_help = "Examples:\n  sarah params bake runs/train-1\n  \
        sarah params bake my-params.toml --into default-params.toml")]
    Bake {
        /// A run folder, or a parameter file.
        from: PathBuf,
        /// The file the firmware is built from. Keeps its comments; [origin] is replaced.
        #[arg(long, default_value = "default-params.toml")]
        into: PathBuf,
    },
}

#[derive(Args, Debug)]
pub(super) struct ShowArgs {
    /// A parameter file, a run folder, default; with --link also applied, staged or stored.
    source: Option<Source>,
    #[command(flatten)]
    link: RobotArgs,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Args, Debug)]
pub(super) struct GetArgs {
    /// Name in Table I, for instance H2.
    #[arg(value_parser = place)]
    symbol: usize,
    /// A parameter file, a run folder, default; with --link also applied (then the default), staged or stored.
    source: Option<Source>,
    #[command(flatten)]
    link: RobotArgs,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Args, Debug)]
pub(super) struct SetArgs {
    /// New values, for instance H2=4.4; on top of --from if that is given.
    #[arg(value_name = "SYMBOL=VALUE", required_unless_present = "from")]
    values: Vec<Assignment>,
    /// Take this whole set: a parameter file, a run folder, default; with --link also stored.
    #[arg(long, value_name = "SOURCE")]
    from: Option<Source>,
    #[command(flatten)]
    link: RobotArgs,
    /// Change this parameter file instead of a robot. Keeps its comments.
    #[arg(long, conflicts_with = "link", required_unless_present = "link")]
    file: Option<PathBuf>,
    /// Keep the set over power cycles too.
    #[arg(long, requires = "link", conflicts_with = "file")]
    commit: bool,
}

#[derive(Args, Debug)]
pub(super) struct DiffArgs {
    /// A parameter file, a run folder, default; with --link also applied, staged or stored.
    a: Source,
    /// The same.
    b: Source,
    #[command(flatten)]
    link: RobotArgs,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Args, Debug)]
pub(super) struct CommitArgs {
    /// serial:PATH, or serial for the only board.
    #[arg(long, value_name = "serial:PATH")]
    link: Target,
}

#[derive(Args, Debug)]
struct RobotArgs {
    /// A robot: serial:PATH, or serial for the only board.
    #[arg(long, value_name = "serial:PATH")]
    link: Option<Target>,
}

/// Does what the arguments say.
pub(super) fn run(verb: &ParamsVerb) -> Result<(), CliError> {
    match verb {
        ParamsVerb::Show(args) => show(args),
        ParamsVerb::Get(args) => get(args),
        ParamsVerb::Set(args) => match (&args.link.link, &args.file) {
            (Some(target), _) => set_robot(args, target),
            (None, Some(file)) => set_file(args, file),
            // The arguments are declared so that one of them is there.
            (None, None) => Ok(()),
        },
        ParamsVerb::Diff(args) => diff(args),
        ParamsVerb::Commit(args) => commit(&args.link),
        ParamsVerb::Bake { from, into } => bake_verb(from, into),
    }
}

fn show(args: &ShowArgs) -> Result<(), CliError> {
    let (Some(target), None) = (&args.link.link, &args.source) else {
        let source = args.source.clone().unwrap_or(Source::Default);
        let set = Sources::new(&args.link).get(&source)?;
        let name = source.to_string();
        print(args.json, || table::json_one(&name, &set).to_string(), || table::one(&title(&source), &set));
        return Ok(());
    };
    let (port, sets) = read(target)?;
    print(args.json, || table::json_robot(&port, &sets).to_string(), || table::robot(&port, &sets));
    Ok(())
}

fn get(args: &GetArgs) -> Result<(), CliError> {
    let usual = if args.link.link.is_some() { Source::Robot(Which::Applied) } else { Source::Default };
    let set = Sources::new(&args.link).get(args.source.as_ref().unwrap_or(&usual))?;
    let (spec, value) = (&SPECS[args.symbol], set.values()[args.symbol]);
    print(args.json, || table::json_value(spec, value).to_string(), || value.to_string());
    Ok(())
}

fn diff(args: &DiffArgs) -> Result<(), CliError> {
    let mut sources = Sources::new(&args.link);
    let (a, b) = (sources.get(&args.a)?, sources.get(&args.b)?);
    let (names, sets) = ([args.a.to_string(), args.b.to_string()], [&a, &b]);
    let names = names.each_ref().map(String::as_str);
    print(args.json, || table::json_diff(names, sets).to_string(), || table::diff(names, sets));
    Ok(())
}

fn set_file(args: &SetArgs, file: &Path) -> Result<(), CliError> {
    let before = load_param_set(file)?.0;
    let base = match &args.from {
        Some(source) => Sources::new(&args.link).get(source)?,
        None => before,
    };
    let after = assign(&base, &args.values)?;
    if before == after {
        tell(&format!("{}: nothing to change", file.display()));
        return Ok(());
    }
    write_into(file, &after)?;
    let name = file.display().to_string();
    tell(table::diff([&format!("{name}, before"), &name], [&before, &after]).trim_end());
    Ok(())
}

fn set_robot(args: &SetArgs, target: &Target) -> Result<(), CliError> {
    // What can be wrong without a robot is said before it is bothered.
    let from = match &args.from {
        Some(Source::Robot(_)) | None => None,
        Some(source) => Some(Sources::new(&args.link).get(source)?),
    };
    let link = Link::open(target, Role::Writer).map_err(RobotError::from)?;
    let mut errand = Errand::read(Role::Writer);
    run_errand(&link, &mut errand, &mut tell)?;
    let before = errand.sets().get(Which::Applied)?;
    let base = match (from, &args.from) {
        (Some(set), _) => set,
        (None, Some(Source::Robot(which))) => errand.sets().get(*which)?,
        (None, _) => before,
    };
    let goal = assign(&base, &args.values)?;
    if errand.change(link.now_us(), goal)? {
        tell(table::diff(["in force before", "asked for"], [&before, &goal]).trim_end());
        run_errand(&link, &mut errand, &mut tell)?;
    } else {
        tell("in force already, nothing to change");
    }
    if args.commit {
        errand.keep(link.now_us());
        run_errand(&link, &mut errand, &mut tell)?;
    } else if errand.sets().get(Which::Stored)? != goal {
        tell(
            "not stored: 10 s after the last host has gone the robot returns to its stored set; \
             set it with --commit to keep it",
        );
    }
    Ok(())
}

fn commit(target: &Target) -> Result<(), CliError> {
    let link = Link::open(target, Role::Writer).map_err(RobotError::from)?;
    let mut errand = Errand::read(Role::Writer);
    run_errand(&link, &mut errand, &mut tell)?;
    let (stored, applied) = (errand.sets().get(Which::Stored)?, errand.sets().get(Which::Applied)?);
    tell(table::diff(["stored before", "in force"], [&stored, &applied]).trim_end());
    errand.keep(link.now_us());
    run_errand(&link, &mut errand, &mut tell)?;
    Ok(())
}

fn bake_verb(from: &Path, into: &Path) -> Result<(), CliError> {
    let baked = bake(from, into)?;
    for (symbol, before, after) in &baked.changed {
        let before = before.map_or("new".into(), |before| before.to_string());
        tell(&format!("{symbol}: {before} -> {after}"));
    }
    let count = baked.changed.len();
    let (into, from) = (into.display(), baked.from.display());
    tell(&format!("{into}: {count} changed, from {from}; `cargo firmware` builds it in"));
    Ok(())
}

fn title(source: &Source) -> String {
    match source {
        Source::Default => "default (built into this version's firmware)".into(),
        other => other.to_string(),
    }
}

/// The robot's sets; who only reads needs no claim.
fn read(target: &Target) -> Result<(String, RobotSets), CliError> {
    let link = Link::open(target, Role::Observer).map_err(RobotError::from)?;
    let mut errand = Errand::read(Role::Observer);
    run_errand(&link, &mut errand, &mut |_| ())?;
    Ok((link.health().port, *errand.sets()))
}

/// Sets by name; the robot is asked once, if at all.
struct Sources<'a> {
    target: Option<&'a Target>,
    robot: Option<RobotSets>,
}

impl<'a> Sources<'a> {
    fn new(link: &'a RobotArgs) -> Sources<'a> {
        Sources { target: link.link.as_ref(), robot: None }
    }

    fn get(&mut self, source: &Source) -> Result<ParamSet, CliError> {
        let which = match source {
            Source::Robot(which) => *which,
            Source::Default => return Ok(default_params()),
            Source::Path(path) => return Ok(load(path)?),
        };
        let sets = match (self.robot, self.target) {
            (Some(sets), _) => sets,
            (None, Some(target)) => read(target)?.1,
            (None, None) => return Err(RobotError::NoLink(name(which)).into()),
        };
        self.robot = Some(sets);
        Ok(sets.get(which)?)
    }
}

fn print(json: bool, program: impl FnOnce() -> String, people: impl FnOnce() -> String) {
    let text = if json { program() } else { people() };
    tell(text.trim_end());
}

/// A line to standard output. That nobody reads on, as in `… | head`, is no error.
fn tell(text: &str) {
    let _ = writeln!(std::io::stdout(), "{text}");
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, Parser};

    use super::super::Cli;

    fn refused(line: &str) -> String {
        Cli::try_parse_from(line.split_whitespace()).expect_err(line).to_string()
    }

    #[test]
    fn every_example_of_every_verb_parses() {
        let cli = Cli::command();
        let params = cli.find_subcommand("params").expect("params is a verb");
        for verb in params.get_subcommands() {
            let help = verb.get_after_help().map(ToString::to_string).unwrap_or_default();
            let examples = help.lines().skip(1).take_while(|line| !line.is_empty()).map(str::trim);
            let examples: Vec<&str> = examples.collect();
            assert!(!examples.is_empty(), "{} has no examples", verb.get_name());
            for example in examples {
                assert!(example.starts_with(&format!("sarah params {}", verb.get_name())), "{example}");
                // What is set off by spaces explains.
                let command = example.split("  ").next().unwrap_or_default();
                let parsed = Cli::try_parse_from(command.split_whitespace());
                assert!(parsed.is_ok(), "{example}: {}", parsed.expect_err("refused"));
            }
        }
    }

    #[test]
    fn mistakes_are_caught_before_a_robot_is_bothered() {
        assert!(refused("sarah params set P1=0.05").contains("--file"));
        assert!(refused("sarah params set --link serial").contains("SYMBOL=VALUE"));
        assert!(refused("sarah params set P1=7 --link serial").contains("P1 = 7 is out of range"));
        assert!(refused("sarah params set P1=0.1 --file a --link serial").contains("cannot be used with"));
        assert!(refused("sarah params set P1=0.1 --file a --commit").contains("cannot be used with"));
        assert!(refused("sarah params get Q7").contains("there is no parameter"));
        assert!(refused("sarah params commit").contains("--link"));
        assert!(refused("sarah params show --link tcp:1").contains("serial:PATH"));
    }
}
