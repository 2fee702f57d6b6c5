//! Which boards are plugged in, from what Linux knows of its USB devices. Elsewhere nothing is known.

use std::fs;
use std::path::Path;

/// A probe on USB.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Probe {
    /// Its serial number.
    pub serial: String,
    /// What it calls itself.
    pub product: String,
}

/// The probes plugged in, by serial number.
pub fn attached() -> Vec<Probe> {
    attached_below(Path::new("/sys/bus/usb/devices"))
}

fn attached_below(devices: &Path) -> Vec<Probe> {
    let Ok(entries) = fs::read_dir(devices) else { return Vec::new() };
    let mut probes: Vec<Probe> = entries.flatten().filter_map(|entry| probe(&entry.path())).collect();
    probes.sort_by(|a, b| a.serial.cmp(&b.serial));
    probes
}

fn probe(device: &Path) -> Option<Probe> {
    let read = |name: &str| fs::read_to_string(device.join(name)).ok().map(|text| text.trim().to_owned());
    let product = read("product")?;
    // The same words by which OpenOCD knows a probe.
    product.contains("CMSIS-DAP").then_some(Probe { serial: read("serial").unwrap_or_default(), product })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probes_are_told_from_other_devices() {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, product, serial) in [
            ("1-1", "EDBG CMSIS-DAP\n", "ATML2\n"),
            ("1-2", "Keyboard\n", "K\n"),
            ("1-3", "EDBG CMSIS-DAP\n", "ATML1\n"),
        ] {
            let device = folder.path().join(name);
            fs::create_dir(&device).expect("creates");
            fs::write(device.join("product"), product).expect("writes");
            fs::write(device.join("serial"), serial).expect("writes");
        }
        fs::create_dir(folder.path().join("usb1")).expect("creates");
        let serials: Vec<String> = attached_below(folder.path()).into_iter().map(|probe| probe.serial).collect();
        assert_eq!(serials, ["ATML1", "ATML2"]);
        assert_eq!(attached_below(Path::new("/no/such/folder")), []);
    }
}
