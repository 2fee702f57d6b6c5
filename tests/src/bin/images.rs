//! Builds the images and judges them by `firmware/budget.toml`: `cargo images`.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use sarah_tests::images::{Budget, Image, judge};

fn main() -> ExitCode {
    match run() {
        Ok(complaints) if complaints.is_empty() => ExitCode::SUCCESS,
        Ok(complaints) => {
            for complaint in complaints {
                eprintln!("images: {complaint}");
            }
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("images: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<Vec<String>, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let built = Command::new(cargo).args(["firmware", "--quiet"]).current_dir(&root).status();
    if !built.map_err(|error| format!("cargo does not start: {error}"))?.success() {
        return Err("`cargo firmware` failed: see above".into());
    }
    let file = root.join("firmware/budget.toml");
    let text = std::fs::read_to_string(&file).map_err(|error| format!("{}: {error}", file.display()))?;
    let budget: Budget = toml::from_str(&text).map_err(|error| format!("firmware/budget.toml: {error}"))?;
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or(root.join("target"), PathBuf::from);
    let mut complaints = Vec::new();
    for name in budget.tick.keys() {
        let elf = target.join("thumbv6m-none-eabi/firmware").join(name);
        let bytes = std::fs::read(&elf).map_err(|error| format!("{}: {error}", elf.display()))?;
        let image = Image::read(&bytes).map_err(|error| format!("{}: {error}", elf.display()))?;
        let findings = judge(name, &image, &budget);
        print!("{}", findings.text);
        complaints.extend(findings.complaints);
    }
    Ok(complaints)
}
