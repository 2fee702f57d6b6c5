//! `sarah study`: what is asked, in a file; what came out, in a folder.

use std::path::{Path, PathBuf};

use clap::Subcommand;

use crate::run::read_text;
use crate::study::document::Document;
use crate::study::{self, Plan, StudyError, StudyFile, report};

#[derive(Subcommand, Debug)]
pub(super) enum StudyVerb {
    /// Run studies, or what is left of them, and write their reports.
    Run {
        /// A study, a TOML file; tests/studies has examples. Several are run one after the other.
        #[arg(required = true)]
        files: Vec<PathBuf>,
        /// Its folder; by default runs/study-NAME. Of several studies the folder of their folders. A study that was begun
        /// before is gone on with.
        #[arg(long)]
        out: Option<PathBuf>,
        /// A Markdown file to put their tables into, each between the lines `<!-- study NAME -->` and
        /// `<!-- end of study -->`.
        #[arg(long, value_name = "FILE")]
        into: Option<PathBuf>,
        /// Check the studies, print them as resolved, and stop.
        #[arg(long)]
        print_config: bool,
    },
    /// Write tables, figures and report.md again from the data of studies.
    Report {
        /// A study's folder.
        #[arg(required = true)]
        folders: Vec<PathBuf>,
        /// A Markdown file to put their tables into, as for `run`; NAME is that of the folder.
        #[arg(long, value_name = "FILE")]
        into: Option<PathBuf>,
    },
}

pub(super) fn run(verb: &StudyVerb) -> Result<(), StudyError> {
    match verb {
        StudyVerb::Run { files, out, into, print_config } => {
            // A mistake in the last is told before the first has taken its hours.
            let plans: Vec<Plan> = files
                .iter()
                .map(|file| Plan::of(&StudyFile::parse(&file.display().to_string(), &read_text(file)?)?))
                .collect::<Result<_, _>>()?;
            if *print_config {
                for plan in &plans {
                    print!("{}", plan.to_toml()?);
                }
                return Ok(());
            }
            let document = document(into.as_deref(), files.iter().map(|file| file.file_stem()))?;
            for (file, plan) in files.iter().zip(&plans) {
                let name = name(file.file_stem());
                let folder = match out {
                    Some(out) if files.len() > 1 => out.join(&name),
                    Some(out) => out.clone(),
                    None => PathBuf::from(format!("runs/study-{name}")),
                };
                let brief = study::run::run(plan, &folder)?;
                document.iter().try_for_each(|document| document.write(&name, &brief))?;
            }
        }
        StudyVerb::Report { folders, into } => {
            let document = document(into.as_deref(), folders.iter().map(|folder| folder.file_name()))?;
            for folder in folders {
                let brief = report::again(folder)?;
                document.iter().try_for_each(|document| document.write(&name(folder.file_name()), &brief))?;
            }
        }
    }
    Ok(())
}

fn name(of: Option<&std::ffi::OsStr>) -> String {
    of.map_or_else(|| "study".into(), |name| name.to_string_lossy().into_owned())
}

fn document<'a>(
    path: Option<&Path>,
    studies: impl Iterator<Item = Option<&'a std::ffi::OsStr>>,
) -> Result<Option<Document>, StudyError> {
    let studies: Vec<String> = studies.map(name).collect();
    path.map(|path| Document::open(path.to_path_buf(), &studies)).transpose()
}
