//! The IMU: a Bosch BMI323 on SPI, by the `bmi323-driver` crate, in the counts the coordinator takes.
//!
//! | | setting | why |
//! |---|---|---|
//! | accelerometer | ±16 g, 2048 counts/g | a landing on rigid feet passes 8 g |
//! | gyroscope | ±2000 °/s, 16.384 counts per °/s (data sheet, rounded there to 16.4) | 0.1 % less than the coordinator reckons with |
//! | rate | 1600 Hz, low-pass at a quarter of it | read at 1 kHz: a sample is 0.6 ms old at most |
//!
//! The driver is `no_std`, speaks embedded-hal 1.0, knows both buses and is kept (edition 2024, tested in its own CI).
//! Mount the sensor with x forward, y left and z up. UNVERIFIED on silicon.

use bmi323_driver::{
    AccelConfig, AccelMode, AccelRange, AverageSamples, Bandwidth, Bmi323, Error, GyroConfig, GyroMode, GyroRange,
    OutputDataRate, SpiTransport,
};
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::SpiDevice;

use crate::coordinator::ImuSample;

const ACCEL: AccelConfig = AccelConfig {
    mode: AccelMode::HighPerformance,
    average: AverageSamples::Avg1,
    bandwidth: Bandwidth::OdrOver4,
    range: AccelRange::G16,
    odr: OutputDataRate::Hz1600,
};
const GYRO: GyroConfig = GyroConfig {
    mode: GyroMode::HighPerformance,
    average: AverageSamples::Avg1,
    bandwidth: Bandwidth::OdrOver4,
    range: GyroRange::Dps2000,
    odr: OutputDataRate::Hz1600,
};

/// Equal samples in a row after which the sensor counts as stuck: its noise is several counts.
const STUCK: u8 = 20;

/// Why there is no sample.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ImuError {
    /// The bus failed.
    Bus,
    /// Another chip answers, or none (0x00, 0xff).
    Stranger(u8),
    /// The sensor reports a fatal error of its own.
    Sick,
    /// It answers with what no living sensor says: the same sample again and again, or only ones or zeros.
    Stuck,
}

impl<E> From<Error<E>> for ImuError {
    fn from(error: Error<E>) -> ImuError {
        match error {
            Error::InvalidChipId(id) => ImuError::Stranger(id),
            Error::FatalError => ImuError::Sick,
            _ => ImuError::Bus,
        }
    }
}

/// The sensor.
pub struct Imu<Spi> {
    device: Bmi323<SpiTransport<Spi>>,
    last: ImuSample,
    same: u8,
}

impl<Spi: SpiDevice> Imu<Spi> {
    /// Touches nothing; mode 0 or 3, at most 10 MHz.
    pub fn new(spi: Spi) -> Imu<Spi> {
        Imu { device: Bmi323::new_spi(spi), last: ImuSample::default(), same: 0 }
    }

    /// Resets and sets the sensor up; takes 2.3 ms. Samples are good 2 ms later (data sheet, gyroscope start-up 45 ms:
    /// until then they read as invalid, which counts as stuck).
    pub fn start(&mut self, delay: &mut impl DelayNs) -> Result<(), ImuError> {
        // Nothing new has been heard from it yet.
        self.same = STUCK;
        self.device.init(delay)?;
        self.device.set_accel_config(ACCEL)?;
        self.device.set_gyro_config(GYRO)?;
        Ok(())
    }

    /// The newest sample: 14 bytes.
    pub fn read(&mut self) -> Result<ImuSample, ImuError> {
        let data = self.device.read_imu_data()?;
        let sample = ImuSample {
            accel: [data.accel.x, data.accel.y, data.accel.z],
            gyro: [data.gyro.x, data.gyro.y, data.gyro.z],
        };
        self.same = if sample == self.last { self.same.saturating_add(1) } else { 0 };
        self.last = sample;
        // i16::MIN is the sensor's own word for "no sample yet".
        let dead = |value: i16| matches!(value, 0 | -1 | i16::MIN);
        let dead = sample.accel.into_iter().all(dead) || sample.gyro.contains(&i16::MIN);
        if dead || self.same >= STUCK { Err(ImuError::Stuck) } else { Ok(sample) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_hal::spi::{ErrorType, Operation};
    use std::convert::Infallible;

    /// A BMI323 as its data sheet describes it on SPI: 7-bit address, one dummy byte, 16-bit registers.
    struct Sensor {
        registers: [u16; 128],
        moving: bool,
    }

    impl Sensor {
        fn new() -> Sensor {
            let mut registers = [0; 128];
            registers[0] = 0x43;
            Sensor { registers, moving: true }
        }
    }

    impl ErrorType for Sensor {
        type Error = Infallible;
    }

    impl SpiDevice for Sensor {
        fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
            let mut address = 0;
            for operation in operations {
                match operation {
                    Operation::Write(bytes) => {
                        address = usize::from(bytes[0] & 0x7f);
                        if bytes[0] & 0x80 == 0 {
                            self.registers[address] = u16::from_le_bytes([bytes[1], bytes[2]]);
                        }
                    }
                    Operation::Read(bytes) => {
                        if self.moving {
                            self.registers[3] = self.registers[3].wrapping_add(1);
                        }
                        bytes[0] = 0xa5;
                        for (index, byte) in bytes[1..].iter_mut().enumerate() {
                            *byte = self.registers[address + index / 2].to_le_bytes()[index % 2];
                        }
                    }
                    _ => panic!("not used"),
                }
            }
            Ok(())
        }
    }

    struct NoDelay;
    impl DelayNs for NoDelay {
        fn delay_ns(&mut self, _: u32) {}
    }

    #[test]
    fn ranges_and_rate_are_the_ones_the_coordinator_reckons_with() {
        let mut imu = Imu::new(Sensor::new());
        imu.start(&mut NoDelay).expect("starts");
        let sensor = imu.device.destroy();
        // mode 7 │ average 0 │ quarter bandwidth │ range 3 (±16 g), 4 (±2000 °/s) │ 1600 Hz
        assert_eq!(sensor.registers[0x20], 0x70bc);
        assert_eq!(sensor.registers[0x21], 0x70cc);
    }

    #[test]
    fn a_sample_is_the_registers_in_order() {
        let mut sensor = Sensor::new();
        sensor.registers[3..9].copy_from_slice(&[99, 200, 2048, 1, 0xffff, 3]);
        let sample = Imu::new(sensor).read().expect("a sample");
        assert_eq!(sample, ImuSample { accel: [100, 200, 2048], gyro: [1, -1, 3] });
    }

    #[test]
    fn a_sensor_that_is_absent_wrong_or_stuck_gives_no_samples() {
        for (id, error) in [(0xff, ImuError::Stranger(0xff)), (0x24, ImuError::Stranger(0x24))] {
            let mut sensor = Sensor::new();
            sensor.registers[0] = id;
            assert_eq!(Imu::new(sensor).start(&mut NoDelay), Err(error));
        }
        for level in [0, 0xffff, 0x8000] {
            let mut sensor = Sensor::new();
            sensor.moving = false;
            sensor.registers[3..9].fill(level);
            assert_eq!(Imu::new(sensor).read(), Err(ImuError::Stuck));
        }
        let mut sensor = Sensor::new();
        sensor.moving = false;
        sensor.registers[3..9].copy_from_slice(&[1, 2, 2048, 4, 5, 6]);
        let mut imu = Imu::new(sensor);
        let good = (0..100).take_while(|_| imu.read().is_ok()).count();
        assert_eq!(good, usize::from(STUCK));
        imu.start(&mut NoDelay).expect("answers");
        assert_eq!(imu.read(), Err(ImuError::Stuck), "setting it up anew does not make it live");
    }
}
