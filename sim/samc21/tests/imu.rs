//! The driver that the firmware uses, against the sensor's model.

use std::convert::Infallible;

use bmi323_driver::{
    AccelConfig, AccelMode, AccelRange, Bmi323, Error, GyroConfig, GyroMode, GyroRange, OutputDataRate,
};
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice as _};
use samc21::wires::SpiDevice;
use samc21::{Cycles, ImuDevice};
use std::cell::Cell;

/// SPI at 6 MHz to the model, and the time.
struct Bus<'a> {
    device: &'a mut ImuDevice,
    now: &'a Cell<u64>,
}

impl Bus<'_> {
    fn byte(&mut self, out: u8) -> u8 {
        self.now.set(self.now.get() + 64);
        self.device.exchange(out, Cycles(self.now.get()))
    }
}

impl ErrorType for Bus<'_> {
    type Error = Infallible;
}

impl embedded_hal::spi::SpiDevice for Bus<'_> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        self.device.select(true, Cycles(self.now.get()));
        for operation in operations {
            match operation {
                Operation::Read(into) => into.iter_mut().for_each(|byte| *byte = self.byte(0)),
                Operation::Write(bytes) => bytes.iter().for_each(|byte| {
                    self.byte(*byte);
                }),
                _ => panic!("the driver does not use this"),
            }
        }
        self.device.select(false, Cycles(self.now.get()));
        Ok(())
    }
}

struct Wait<'a>(&'a Cell<u64>);

impl DelayNs for Wait<'_> {
    fn delay_ns(&mut self, ns: u32) {
        self.0.set(self.0.get() + u64::from(ns) * 48 / 1000);
    }
}

const ACCEL: AccelConfig = AccelConfig {
    mode: AccelMode::HighPerformance,
    average: bmi323_driver::AverageSamples::Avg1,
    bandwidth: bmi323_driver::Bandwidth::OdrOver4,
    range: AccelRange::G16,
    odr: OutputDataRate::Hz1600,
};
const GYRO: GyroConfig = GyroConfig {
    mode: GyroMode::HighPerformance,
    average: bmi323_driver::AverageSamples::Avg1,
    bandwidth: bmi323_driver::Bandwidth::OdrOver4,
    range: GyroRange::Dps2000,
    odr: OutputDataRate::Hz1600,
};

#[test]
fn the_driver_sets_the_sensor_up_and_reads_what_it_measures() {
    let (mut sensor, now) = (ImuDevice::default(), Cell::new(0));
    sensor.set([1, -2, 2048], [100, -200, 300]);
    let mut driver = Bmi323::new_spi(Bus { device: &mut sensor, now: &now });
    let state = driver.init(&mut Wait(&now)).expect("the sensor answers");
    assert_eq!(state.chip_id, 0x43);
    assert!(state.status.por_detected() && !state.error.fatal());
    driver.set_accel_config(ACCEL).expect("written");
    driver.set_gyro_config(GYRO).expect("written");
    let data = driver.read_imu_data().expect("read");
    assert_eq!([data.accel.x, data.accel.y, data.accel.z], [1, -2, 2048]);
    assert_eq!([data.gyro.x, data.gyro.y, data.gyro.z], [100, -200, 300]);
    assert_eq!(driver.read_gyro().expect("read").y, -200);
    let status = driver.status_word().expect("read");
    assert!(status.drdy_accel() && status.drdy_gyro() && !status.por_detected());
    assert_eq!((sensor.register(0x20), sensor.register(0x21)), (0x70bc, 0x70cc));
}

#[test]
fn a_sensor_that_is_off_gives_the_invalid_value() {
    let (mut sensor, now) = (ImuDevice::default(), Cell::new(0));
    sensor.set([1, 2, 3], [4, 5, 6]);
    let mut driver = Bmi323::new_spi(Bus { device: &mut sensor, now: &now });
    driver.init(&mut Wait(&now)).expect("the sensor answers");
    driver.set_accel_config(ACCEL).expect("written");
    let data = driver.read_imu_data().expect("read");
    assert_eq!((data.accel.x, data.gyro.x), (1, i16::MIN));
}

#[test]
fn without_the_start_up_time_nothing_answers() {
    struct Hurry;
    impl DelayNs for Hurry {
        fn delay_ns(&mut self, _: u32) {}
    }
    let (mut sensor, now) = (ImuDevice::default(), Cell::new(0));
    // A first transfer makes the interface SPI, so that the driver's reset is heard.
    Bus { device: &mut sensor, now: &now }.transaction(&mut []).expect("select rises");
    let mut driver = Bmi323::new_spi(Bus { device: &mut sensor, now: &now });
    assert!(matches!(driver.init(&mut Hurry), Err(Error::InvalidChipId(0xff))));
}
