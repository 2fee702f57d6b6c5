//! Builds probe-rs' flash algorithm from `firmware/probe-rs/algorithm` and writes the chip description around it.

use std::path::Path;
use std::process::{Command, ExitCode};

use object::{Object, ObjectSection, ObjectSymbol};

fn main() -> ExitCode {
    match run() {
        Ok(message) => {
            println!("{message}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("chip-description: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<String, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../firmware/probe-rs");
    let target = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/algorithm");
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut build = Command::new(cargo);
    build.args(["build", "--quiet", "--release", "--target", "thumbv6m-none-eabi", "--target-dir"]).arg(&target);
    let built = build.current_dir(root.join("algorithm")).status();
    if !built.map_err(|error| format!("cargo does not start: {error}"))?.success() {
        return Err("the algorithm does not build: see above".into());
    }
    let elf = target.join("thumbv6m-none-eabi/release/samc21-flash-algorithm");
    let bytes = std::fs::read(&elf).map_err(|error| format!("{}: {error}", elf.display()))?;
    let text = describe(&bytes)?;
    let file = root.join("ATSAMC21J18A.yaml");
    let same = std::fs::read_to_string(&file).is_ok_and(|old| old == text);
    std::fs::write(&file, text).map_err(|error| format!("{}: {error}", file.display()))?;
    Ok(format!("firmware/probe-rs/ATSAMC21J18A.yaml: {}", if same { "as before" } else { "written" }))
}

fn describe(elf: &[u8]) -> Result<String, String> {
    let file = object::File::parse(elf).map_err(|error| error.to_string())?;
    let code = file.section_by_name("PrgCode").and_then(|section| section.data().ok()).ok_or("no PrgCode")?;
    let entry = |name: &str| {
        let symbol = file.symbols().find(|symbol| symbol.name() == Ok(name)).ok_or(format!("no {name}"))?;
        Ok::<u64, String>(symbol.address() | 1)
    };
    Ok(format!(
        "# Made by `cargo run -p sarah-tests --bin chip-description` from firmware/probe-rs/algorithm. NOT run on silicon yet.\n\
         name: SAMC21\n\
         manufacturer:\n  id: 0x1f\n  cc: 0x0\n\
         variants:\n\
         - name: ATSAMC21J18A\n\
         \x20 cores:\n  - name: main\n    type: armv6m\n    core_access_options: !Arm\n      ap: !v1 0\n\
         \x20 memory_map:\n\
         \x20 - !Nvm\n    range:\n      start: 0x0\n      end: 0x40000\n    cores:\n    - main\n    access:\n      boot: true\n\
         \x20 - !Ram\n    range:\n      start: 0x20000000\n      end: 0x20008000\n    cores:\n    - main\n\
         \x20 flash_algorithms:\n  - samc21-256k\n\
         flash_algorithms:\n\
         - name: samc21-256k\n  description: SAM C21 main array, 256 KiB\n  default: true\n\
         \x20 instructions: {}\n\
         \x20 pc_init: {:#x}\n  pc_uninit: {:#x}\n  pc_program_page: {:#x}\n  pc_erase_sector: {:#x}\n  pc_erase_all: {:#x}\n\
         \x20 data_section_offset: {:#x}\n\
         \x20 flash_properties:\n    address_range:\n      start: 0x0\n      end: 0x40000\n    page_size: 0x100\n\
         \x20   erased_byte_value: 0xff\n    program_page_timeout: 100\n    erase_sector_timeout: 1000\n\
         \x20   sectors:\n    - size: 0x100\n      address: 0x0\n\
         \x20 cores:\n  - main\n",
        base64(code),
        entry("Init")?,
        entry("UnInit")?,
        entry("ProgramPage")?,
        entry("EraseSector")?,
        entry("EraseChip")?,
        code.len(),
    ))
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for group in bytes.chunks(3) {
        let word = group.iter().fold(0_u32, |word, byte| word << 8 | u32::from(*byte)) << (8 * (3 - group.len()));
        for digit in 0..4 {
            let value = word >> (18 - 6 * digit) & 63;
            text.push(if digit > group.len() { '=' } else { DIGITS[value as usize].into() });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    #[test]
    fn base64_is_that_of_rfc_4648() {
        for (plain, coded) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(super::base64(plain.as_bytes()), coded);
        }
    }
}
