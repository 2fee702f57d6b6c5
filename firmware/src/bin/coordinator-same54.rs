//! The image of the coordinator for the SAM E54 Xplained Pro: IMU, parameter sets, host link.
#![no_std]
#![no_main]

#[cortex_m_rt::entry]
fn main() -> ! {
    sarah_firmware::board::same54::coordinator::run()
}
