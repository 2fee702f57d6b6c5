//! What goes into the control code of the chips and what comes out, call by call, for whoever wants to repeat it.
//!
//! | chip | in | out |
//! |---|---|---|
//! | coordinator | [`Passing::Frame`], [`Passing::Turn`] | [`Passing::Sent`], [`Passing::Told`], [`Passing::Stored`] |
//! | node | [`Passing::Frame`], [`Passing::Tick`] | [`Passing::Sent`], [`Passing::Commands`] |
//!
//! The software in the loop passes the outputs of a call before the next input of that chip. Emulated chips lag: a
//! command is seen on the timer one tick later, a frame when it has passed the bus.

use sarah_firmware::calibration::{Command, Counts};
use sarah_firmware::coordinator::ImuSample;
use sarah_protocol::bus::Frame;

use crate::bus::Station;

/// One thing on its way into or out of a chip's control code.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Passing<'a> {
    /// In: a frame from the bus.
    Frame(&'a Frame),
    /// In: a control tick of a node.
    Tick {
        /// Since the tick before, µs.
        dt_us: u32,
        /// What its converter read.
        counts: &'a Counts,
    },
    /// In: a turn of the coordinator.
    Turn {
        /// Bytes from the host since the turn before.
        host: &'a [u8],
        /// What its IMU measured.
        imu: &'a ImuSample,
    },
    /// Out: what the left and the right actuator of a node are told.
    Commands([Command; 2]),
    /// Out: a frame for the bus.
    Sent(&'a Frame),
    /// Out: bytes for the host.
    Told(&'a [u8]),
    /// Out: the set of this generation went into non-volatile memory.
    Stored(u32),
}

/// Who listens.
pub trait Tap: Send {
    /// `what` passes at `at_us`, µs since power-up.
    fn passes(&mut self, at_us: u64, chip: Station, what: Passing<'_>);
}

/// A place for a tap; without one, nothing happens.
#[derive(Default)]
pub(crate) struct Socket(Option<Box<dyn Tap>>);

impl Socket {
    /// Connects a tap.
    pub(crate) fn connect(&mut self, tap: Box<dyn Tap>) {
        self.0 = Some(tap);
    }

    /// Tells the tap, if there is one.
    pub(crate) fn pass(&mut self, at_us: u64, chip: Station, what: Passing<'_>) {
        if let Some(tap) = &mut self.0 {
            tap.passes(at_us, chip, what);
        }
    }

    /// Whether there is a tap: for what is costly to put into words.
    pub(crate) fn connected(&self) -> bool {
        self.0.is_some()
    }
}
