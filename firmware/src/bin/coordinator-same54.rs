//! The image of the coordinator for the SAM E54 Xplained Pro: IMU, parameter sets, host link.
#![no_std]
#![no_main]

/// Name of this build for the hello: the version, padded with zeros.
const BUILD: [u8; 16] = {
    let version = env!("CARGO_PKG_VERSION").as_bytes();
    let mut build = [0; 16];
    let mut index = 0;
    while index < version.len() && index < build.len() {
        build[index] = version[index];
        index += 1;
    }
    build
};

#[cortex_m_rt::entry]
fn main() -> ! {
    sarah_firmware::board::same54::coordinator::run(BUILD)
}
