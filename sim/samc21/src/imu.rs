//! A Bosch BMI323 on SPI: the registers that a driver needs to set it up and read it (BMI323 data sheet, BST-BMI323-DS000:
//! 6.1 "Register Map", 7.2 "SPI").
//!
//! A transfer is an address byte, highest bit set to read, then 16-bit words, low byte first, at rising addresses. A read
//! has one dummy byte before its first word. What the sensor does not do here: FIFO, interrupts, feature engine.

use crate::time::Cycles;
use crate::wires::SpiDevice;

const CHIP_ID: u8 = 0x00;
const STATUS: u8 = 0x02;
const ACC_DATA_X: u8 = 0x03;
const GYR_DATA_X: u8 = 0x06;
const TEMP_DATA: u8 = 0x09;
const SENSOR_TIME_0: u8 = 0x0a;
const SENSOR_TIME_1: u8 = 0x0b;
const ACC_CONF: u8 = 0x20;
const GYR_CONF: u8 = 0x21;
const CMD: u8 = 0x7e;

/// The register's low byte; the high byte is the silicon's revision.
const CHIP: u16 = 0x0043;
const SOFT_RESET: u16 = 0xdeaf;
const STATUS_POR: u16 = 1 << 0;
const STATUS_READY: u16 = 7 << 5;
/// What a data register holds before the first sample.
const INVALID: u16 = 0x8000;
/// From a reset until the interface answers (1.2, start-up time).
const START: u64 = 2 * Cycles::HZ / 1000;
/// Sensor time counts in 39.0625 µs: 25.6 kHz.
const TIME_TICK: u64 = Cycles::HZ / 25_600;

/// The sensor.
#[derive(Clone, Debug)]
pub struct ImuDevice {
    registers: [u16; 128],
    accel: [i16; 3],
    gyro: [i16; 3],
    /// After a reset the interface is I²C until the first rising select.
    spi: bool,
    starts: Cycles,
    /// Bytes since select fell, the address byte first.
    count: u32,
    address: u8,
    reads: bool,
    low: u8,
    /// The words of this transfer, held so that a sample does not change while it is read.
    shadow: [u16; 12],
}

impl Default for ImuDevice {
    fn default() -> Self {
        ImuDevice {
            registers: reset_values(),
            accel: [0; 3],
            gyro: [0; 3],
            spi: false,
            starts: Cycles(0),
            count: 0,
            address: 0,
            reads: false,
            low: 0,
            shadow: [0; 12],
        }
    }
}

fn reset_values() -> [u16; 128] {
    let mut registers = [0; 128];
    for (register, value) in [(CHIP_ID, CHIP), (STATUS, STATUS_POR), (ACC_CONF, 0x0028), (GYR_CONF, 0x0048)] {
        registers[usize::from(register)] = value;
    }
    registers
}

impl ImuDevice {
    /// Sets what the sensor measures, in counts of the range the firmware chose.
    pub fn set(&mut self, accel: [i16; 3], gyro: [i16; 3]) {
        (self.accel, self.gyro) = (accel, gyro);
    }

    /// A configuration register, for tests.
    pub fn register(&self, address: u8) -> u16 {
        self.registers[usize::from(address & 0x7f)]
    }

    /// Mode 0 switches a sensor off (bits 12 to 14 of its configuration).
    fn is_on(&self, configuration: u8) -> bool {
        self.registers[usize::from(configuration)] >> 12 & 7 != 0
    }

    fn value(&mut self, address: u8, now: Cycles) -> u16 {
        let sample = |on: bool, values: [i16; 3], axis: u8| if on { values[usize::from(axis)] as u16 } else { INVALID };
        match address {
            STATUS => {
                let ready = [self.is_on(GYR_CONF), self.is_on(ACC_CONF)];
                let ready = u16::from(ready[0]) << 6 | u16::from(ready[1]) << 7 | 1 << 5;
                // Reading clears what has been seen; samples come faster than anyone reads.
                std::mem::take(&mut self.registers[usize::from(STATUS)]) & !STATUS_READY | ready
            }
            ACC_DATA_X..GYR_DATA_X => sample(self.is_on(ACC_CONF), self.accel, address - ACC_DATA_X),
            GYR_DATA_X..TEMP_DATA => sample(self.is_on(GYR_CONF), self.gyro, address - GYR_DATA_X),
            // 0 is 23 °C.
            TEMP_DATA => 0,
            SENSOR_TIME_0 => (now.0 / TIME_TICK) as u16,
            SENSOR_TIME_1 => ((now.0 / TIME_TICK) >> 16) as u16,
            _ => self.registers[usize::from(address & 0x7f)],
        }
    }

    fn write(&mut self, address: u8, value: u16, now: Cycles) {
        match address {
            CMD if value == SOFT_RESET => {
                self.registers = reset_values();
                self.spi = false;
                self.starts = now + START;
            }
            // Identity, errors, status and data cannot be written.
            CHIP_ID..=0x0f | CMD => {}
            _ => self.registers[usize::from(address & 0x7f)] = value,
        }
    }
}

impl SpiDevice for ImuDevice {
    fn select(&mut self, selected: bool, now: Cycles) {
        if selected {
            self.count = 0;
        } else if now >= self.starts {
            self.spi = true;
        }
    }

    fn exchange(&mut self, byte: u8, now: Cycles) -> u8 {
        let at = self.count;
        self.count += 1;
        // An interface that is still I²C does not listen to SPI.
        if now < self.starts || !self.spi {
            return 0xff;
        }
        if at == 0 {
            (self.address, self.reads) = (byte & 0x7f, byte & 0x80 != 0);
            return 0xff;
        }
        if !self.reads {
            match at % 2 {
                1 => self.low = byte,
                _ => {
                    let address = self.address.wrapping_add((at / 2 - 1) as u8) & 0x7f;
                    self.write(address, u16::from_le_bytes([self.low, byte]), now);
                }
            }
            return 0xff;
        }
        if at == 1 {
            for word in 0..self.shadow.len() as u8 {
                // Only what is read loses its flags: the status, if the transfer begins with it.
                let address = self.address.wrapping_add(word) & 0x7f;
                if word == 0 || address != STATUS {
                    self.shadow[usize::from(word)] = self.value(address, now);
                }
            }
            return 0;
        }
        let word = (at as usize - 2) / 2;
        let value = match self.shadow.get(word) {
            Some(value) => *value,
            None => self.value(self.address.wrapping_add(word as u8) & 0x7f, now),
        };
        value.to_le_bytes()[at as usize % 2]
    }

    fn boxed_clone(&self) -> Box<dyn SpiDevice> {
        Box::new(self.clone())
    }
}
