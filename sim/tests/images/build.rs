//! The images under test: built from this source when the first test asks for them, where `cargo firmware` puts them.

use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;

use sarah_sim::emulated::Images;

/// The images of this source; built once per process.
pub fn images() -> Images {
    static IMAGES: OnceLock<Result<Images, String>> = OnceLock::new();
    match IMAGES.get_or_init(build) {
        Ok(images) => images.clone(),
        Err(error) => panic!("{error}"),
    }
}

fn build() -> Result<Images, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    // Its `tmp` is where cargo puts what tests make.
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().ok_or("cargo's target folder is the root")?;
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let built = Command::new(cargo)
        .args(["firmware", "--quiet", "--locked", "--target-dir"])
        .arg(target)
        .current_dir(&root)
        .output()
        .map_err(|error| format!("the images cannot be built: cargo does not start: {error}"))?;
    if !built.status.success() {
        let said = String::from_utf8_lossy(&built.stderr);
        return Err(format!(
            "the images cannot be built: `cargo firmware` failed, {}; is the target installed \
             (`rustup target add thumbv6m-none-eabi`)?\n{said}",
            built.status
        ));
    }
    Images::load(&target.join("thumbv6m-none-eabi/firmware")).map_err(|error| error.to_string())
}
