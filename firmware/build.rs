//! Turns `default-params.toml` into a constant, checked with the very limits the robot enforces, and tells the linker
//! how an image is laid out.

use std::error::Error;
use std::path::{Path, PathBuf};

use sarah_protocol::params::{ParamSet, SPECS};

fn main() -> Result<(), Box<dyn Error>> {
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    default_params(&out)?;
    if std::env::var("CARGO_CFG_TARGET_OS")? == "none" {
        let chosen = |feature: &str| std::env::var_os(feature).is_some();
        if chosen("CARGO_FEATURE_SAMC21") {
            let files = [("samc21/memory.x", "board.x"), ("samc21/device.x", "device.x"), ("samc21/fast.x", "fast.x")];
            layout(&out, &files, &["knee", "hip", "abductor"])?;
        } else if chosen("CARGO_FEATURE_SAME54") {
            // The vector names come with the HAL.
            layout(&out, &[("same54/memory.x", "board.x")], &[])?;
        }
    }
    Ok(())
}

/// Memory map (for the `memory.x` of the workspace), vector names and what lies in RAM of the `fast` images, where the
/// linker looks for them. The arguments are given here and not in `.cargo/config.toml`, so that a `RUSTFLAGS` in the
/// environment cannot make an image that does not start.
fn layout(out: &Path, files: &[(&str, &str)], fast: &[&str]) -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/board");
    for (from, to) in files {
        let from = root.join(from);
        println!("cargo::rerun-if-changed={}", from.display());
        std::fs::copy(from, out.join(to))?;
    }
    println!("cargo::rerun-if-changed={}", Path::new(env!("CARGO_MANIFEST_DIR")).join("../memory.x").display());
    println!("cargo::rustc-link-search={}", out.display());
    for image in fast {
        println!("cargo::rustc-link-arg-bin={image}=-Tfast.x");
    }
    for argument in ["-Tlink.x", "-Tdefmt.x", "--nmagic"] {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
    Ok(())
}

fn default_params(out: &Path) -> Result<(), Box<dyn Error>> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../default-params.toml");
    println!("cargo::rerun-if-changed={}", file.display());
    let table: toml::Table = std::fs::read_to_string(&file)?.parse()?;
    let parameters = table.get("parameters").and_then(toml::Value::as_table).ok_or("no [parameters] table")?;
    let mut values = [0.0; SPECS.len()];
    for (value, spec) in values.iter_mut().zip(&SPECS) {
        let given = parameters.get(spec.symbol).and_then(toml::Value::as_float);
        *value = given.ok_or(format!("default-params.toml: {} is missing or not a number", spec.symbol))? as f32;
    }
    if let Some(unknown) = parameters.keys().find(|key| SPECS.iter().all(|spec| spec.symbol != *key)) {
        return Err(format!("default-params.toml: no parameter is called {unknown}").into());
    }
    ParamSet::new(values).map_err(|error| format!("default-params.toml: {error}"))?;
    let source = format!("{values:?}");
    std::fs::write(out.join("default_params.rs"), source)?;
    Ok(())
}
