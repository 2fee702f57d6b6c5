//! Builds the programs in `programs/` for the emulated processor, with the compiler that builds this crate.

#![allow(dead_code, reason = "each test file uses some")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

use samc21::Image;

/// Builds `programs/<name>.rs` with `flags` and reads the image. Once per process: tests run side by side.
pub fn build(name: &str, flags: &[&str]) -> Image {
    static BUILT: Mutex<BTreeMap<String, Image>> = Mutex::new(BTreeMap::new());
    let key = format!("{name} {}", flags.join(" "));
    let mut built = BUILT.lock().expect("no build panicked");
    built.entry(key).or_insert_with(|| compile(name, flags)).clone()
}

fn compile(name: &str, flags: &[&str]) -> Image {
    let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("programs");
    let out = tempdir().join(format!("{name}-{}.elf", std::process::id()));
    let status = Command::new(std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into()))
        .current_dir(&here)
        .args(["--edition=2024", "--target=thumbv6m-none-eabi", "--crate-type=bin", "-Copt-level=s", "-Cpanic=abort"])
        .args(["-Clink-arg=-Tlink.x", "-Cdebuginfo=0", "-Clink-arg=--gc-sections", "-Clinker=rust-lld"])
        .args(flags)
        .arg("-o")
        .arg(&out)
        .arg(format!("{name}.rs"))
        .status()
        .expect("rustc runs");
    assert!(status.success(), "{name}.rs does not build: {status}");
    let elf = std::fs::read(&out).expect("the linker wrote the image");
    std::fs::remove_file(&out).expect("the image can be removed");
    Image::from_elf(&elf).expect("the linker's ELF is a firmware image")
}

fn tempdir() -> PathBuf {
    option_env!("CARGO_TARGET_TMPDIR").map_or_else(std::env::temp_dir, PathBuf::from)
}
