//! Runs instruction cases from standard input and prints their results, see `oracle/README.md`.

#[path = "../oracle/case.rs"]
mod case;

use std::io::{BufRead, Write};

use samc21::{Chip, Image};

fn main() -> std::io::Result<()> {
    let mut chip = Chip::new(&Image::default());
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    for line in std::io::stdin().lock().lines() {
        let result = match case::Case::parse(&line?) {
            Some(case) => case.run(&mut chip),
            None => "malformed".into(),
        };
        writeln!(out, "{result}")?;
    }
    out.flush()
}
