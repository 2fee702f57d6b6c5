//! `sarah study`: what is asked, in a file; what came out, in a folder.

use std::path::PathBuf;

use clap::Subcommand;

use crate::run::read_text;
use crate::study::{self, Plan, StudyError, StudyFile, report};

#[derive(Subcommand, Debug)]
pub(super) enum StudyVerb {
    /// Run a study, or what is left of it, and write its report.
    Run {
        /// The study, a TOML file; tests/studies has examples.
        file: PathBuf,
        /// Its folder; by default runs/study-NAME. One that was begun before is gone on with.
        #[arg(long)]
        out: Option<PathBuf>,
        /// Check the study, print it as resolved, and stop.
        #[arg(long)]
        print_config: bool,
    },
    /// Write tables, figures and report.md again from a study's data.
    Report {
        /// The study's folder.
        folder: PathBuf,
    },
}

pub(super) fn run(verb: &StudyVerb) -> Result<(), StudyError> {
    match verb {
        StudyVerb::Run { file, out, print_config } => {
            let plan = Plan::of(&StudyFile::parse(&file.display().to_string(), &read_text(file)?)?)?;
            if *print_config {
                print!("{}", plan.to_toml()?);
                return Ok(());
            }
            let name = file.file_stem().map_or_else(|| "study".into(), |stem| stem.to_string_lossy());
            let default = PathBuf::from(format!("runs/study-{name}"));
            study::run::run(&plan, out.as_ref().unwrap_or(&default))?;
        }
        StudyVerb::Report { folder } => {
            report::again(folder)?;
        }
    }
    Ok(())
}
