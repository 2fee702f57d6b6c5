//! Turns `default-params.toml` into a constant, checked with the very limits the robot enforces.

use std::error::Error;
use std::path::Path;

use sarah_protocol::params::{ParamSet, SPECS};

fn main() -> Result<(), Box<dyn Error>> {
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
    std::fs::write(Path::new(&std::env::var("OUT_DIR")?).join("default_params.rs"), source)?;
    Ok(())
}
