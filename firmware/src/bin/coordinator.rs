//! The image of the coordinator: IMU, parameter sets, host link.
#![no_std]
#![no_main]

#[cortex_m_rt::entry]
fn main() -> ! {
    sarah_firmware::board::samc21::coordinator::run()
}
