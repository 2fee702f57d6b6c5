//! The emulated IMU between the chip that reads it and the robot that moves it.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use samc21::wires::SpiDevice;
use samc21::{Cycles, ImuDevice};

use crate::sensors::ImuCounts;

/// A handle on one sensor; clones are the same sensor.
#[derive(Clone, Debug, Default)]
pub struct Imu(Arc<Mutex<ImuDevice>>);

impl Imu {
    /// What the sensor measures from now on.
    pub fn set(&self, counts: ImuCounts) {
        self.device().set(counts.accel, counts.gyro);
    }

    fn device(&self) -> MutexGuard<'_, ImuDevice> {
        // Nothing panics while it is held.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl SpiDevice for Imu {
    fn select(&mut self, selected: bool, now: Cycles) {
        self.device().select(selected, now);
    }

    fn exchange(&mut self, byte: u8, now: Cycles) -> u8 {
        self.device().exchange(byte, now)
    }

    /// A snapshot's sensor is its own.
    fn boxed_clone(&self) -> Box<dyn SpiDevice> {
        Box::new(Imu(Arc::new(Mutex::new(self.device().clone()))))
    }
}
