//! Between the chip's counts and units: ADC readings in, PWM commands out.
//!
//! ```text
//!  position   12-bit ADC   (counts − zero) · units per count   ► Q16, m or rad
//!  pad load   12-bit ADC   (counts − zero) · units per count   ► Q16, N
//!  Drive      ► Brake, or direction and duty = |speed| / full speed · PWM_PERIOD
//! ```
//!
//! The simulator speaks in the same counts, so that what a converter's step or a duty's step does to the robot is in
//! every result, and a simulated node computes the very bits a flashed one does.

use sarah_protocol::fixed::Q16;

use crate::lpg::Drive;
use crate::lpg::arithmetic::product;
use crate::node::Sensors;

/// Largest reading of the 12-bit converter.
pub const ADC_MAX: u16 = 4095;
/// Duty of full speed: 48 MHz of timer clock over 20 kHz, above hearing.
pub const PWM_PERIOD: u16 = 2400;

/// What a node's converter read.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Counts {
    /// Joint position \[left, right\].
    pub position: [u16; 2],
    /// Pad loads: left heel, left toe, right heel, right toe. Zero on nodes without pads.
    pub load: [u16; 4],
}

/// What an actuator's pins are set to.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Command {
    /// Brake coil off, no pulses.
    #[default]
    Brake,
    /// Brake coil energised, motor driven.
    Run {
        /// Direction pin: towards larger positions.
        forward: bool,
        /// Pulse width, 0 to [`PWM_PERIOD`].
        duty: u16,
    },
}

/// One analogue input.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Channel {
    /// Reading that means 0.
    pub zero: u16,
    /// Units a count is worth, in steps of 2^-(16 + shift).
    gain: i32,
    shift: u32,
    /// What a reading of 0 is worth, in the same steps, with half a result's step for rounding.
    offset: i32,
}

impl Channel {
    /// A channel that reads `zero` at 0 and changes by `units_per_count`, which lies between 2⁻¹⁵ and 8.
    pub const fn new(zero: u16, units_per_count: f64) -> Channel {
        // The finest gain whose product with any reading fits 31 bits: the multiply is then one instruction on the chip.
        let mut shift = 12;
        let mut scaled = units_per_count * (1_i64 << (16 + shift)) as f64;
        while scaled * ADC_MAX as f64 >= (1_i64 << 30) as f64 {
            shift -= 1;
            scaled *= 0.5;
        }
        assert!(zero <= ADC_MAX && scaled >= 1.0 && shift < 16);
        let gain = (scaled + 0.5) as i32;
        Channel { zero, gain, shift, offset: (1 << shift >> 1) - zero as i32 * gain }
    }

    /// The value of a reading; readings the converter cannot give count as full scale.
    pub const fn value(&self, counts: u16) -> Q16 {
        let counts = if counts > ADC_MAX { ADC_MAX } else { counts };
        Q16((counts as i32 * self.gain + self.offset) >> self.shift)
    }

    /// The reading closest to `value`, as a simulated sensor gives it; NaN reads as [`Channel::zero`].
    pub fn counts(&self, value: f32) -> u16 {
        let per_count = f64::from(self.gain) / (1_i64 << (16 + self.shift)) as f64;
        let away = f64::from(value) / per_count;
        let rounded = if away < 0.0 { away - 0.5 } else { away + 0.5 } as i32;
        rounded.saturating_add(i32::from(self.zero)).clamp(0, i32::from(ADC_MAX)) as u16
    }
}

/// The analogue side of one node.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Calibration {
    /// Joint positions \[left, right\].
    pub position: [Channel; 2],
    /// Pads, in the order of [`Counts::load`]; without them every load is 0.
    pub load: Option<[Channel; 4]>,
    /// Speed at a duty of [`PWM_PERIOD`], m/s or rad/s, above 1/16.
    pub full_speed: Q16,
    /// Counts of duty per step of speed, in steps of 2⁻³²; from `full_speed`.
    duty_per_speed: u32,
}

impl Calibration {
    /// Both joints alike, all pads alike.
    pub const fn new(position: Channel, pad: Option<Channel>, full_speed: Q16) -> Calibration {
        assert!(full_speed.0 > Q16::ONE.0 / 16);
        let duty_per_speed = (((PWM_PERIOD as i64) << 32) / full_speed.0 as i64) as u32;
        let load = match pad {
            Some(pad) => Some([pad; 4]),
            None => None,
        };
        Calibration { position: [position; 2], load, full_speed, duty_per_speed }
    }

    /// What the readings mean.
    pub const fn sensors(&self, counts: &Counts) -> Sensors {
        let Counts { position: [left, right], load: [left_heel, left_toe, right_heel, right_toe] } = *counts;
        Sensors {
            position: [self.position[0].value(left), self.position[1].value(right)],
            load: match &self.load {
                Some([a, b, c, d]) => [a.value(left_heel), b.value(left_toe), c.value(right_heel), d.value(right_toe)],
                None => [Q16::ZERO; 4],
            },
        }
    }

    /// What the sensors would read: the simulator's side of [`Calibration::sensors`].
    pub fn counts(&self, position: [f32; 2], load_n: [f32; 4]) -> Counts {
        let mut counts = Counts::default();
        for (i, value) in position.into_iter().enumerate() {
            counts.position[i] = self.position[i].counts(value);
        }
        for ((counts, channel), value) in counts.load.iter_mut().zip(self.load.iter().flatten()).zip(load_n) {
            *counts = channel.counts(value);
        }
        counts
    }

    /// How a drive is put on the pins; faster than full speed is full speed.
    pub const fn command(&self, drive: Drive) -> Command {
        match drive {
            Drive::Brake => Command::Brake,
            Drive::Velocity(speed) => {
                let (duty, rest) = product(speed.abs().0 as u32, self.duty_per_speed);
                let duty = duty + (rest >> 31);
                let duty = if duty > PWM_PERIOD as u32 { PWM_PERIOD } else { duty as u16 };
                Command::Run { forward: speed.0 >= 0, duty }
            }
        }
    }

    /// Speed an ideal actuator runs at, m/s or rad/s; `None` with the brake on. For the simulator.
    pub fn speed(&self, command: Command) -> Option<f32> {
        match command {
            Command::Brake => None,
            Command::Run { forward, duty } => {
                let speed = self.full_speed.to_f32() * f32::from(duty) / f32::from(PWM_PERIOD);
                Some(if forward { speed } else { -speed })
            }
        }
    }
}

/// Half a newton a count; some counts below zero, for noise and drift.
const PAD: Channel = Channel::new(64, 0.5);

/// Linear actuators: ±0.25 m, 0.12 mm a count.
pub const KNEE: Calibration = Calibration::new(Channel::new(2048, 1.0 / 8192.0), Some(PAD), Q16::ONE);
/// Hips: ±2 rad, 1 mrad a count.
pub const HIP: Calibration = Calibration::new(Channel::new(2048, 1.0 / 1024.0), None, Q16::lit(6.0));
/// Abductors: as the hips.
pub const ABDUCTOR: Calibration = HIP;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ALL: [Calibration; 3] = [KNEE, HIP, ABDUCTOR];

    #[test]
    fn zero_reads_zero_and_full_scale_is_where_it_should_be() {
        assert_eq!(KNEE.position[0].value(2048), Q16::ZERO);
        assert_eq!(KNEE.position[0].value(0), Q16::lit(-0.25));
        assert_eq!(HIP.position[1].value(2048 + 1024), Q16::ONE);
        assert_eq!(PAD.value(64 + 30), Q16::lit(15.0));
        assert_eq!(PAD.value(u16::MAX), PAD.value(ADC_MAX));
    }

    #[test]
    fn full_speed_is_full_duty_and_more_is_no_more() {
        for node in ALL {
            let full = node.command(Drive::Velocity(node.full_speed));
            assert_eq!(full, Command::Run { forward: true, duty: PWM_PERIOD });
            assert_eq!(node.command(Drive::Velocity(Q16::MAX)), full);
            let back = node.command(Drive::Velocity(Q16(i32::MIN)));
            assert_eq!(back, Command::Run { forward: false, duty: PWM_PERIOD });
        }
    }

    #[test]
    fn not_a_number_reads_as_zero() {
        assert_eq!(KNEE.position[0].counts(f32::NAN), 2048);
        assert_eq!(KNEE.position[0].counts(f32::INFINITY), ADC_MAX);
    }

    proptest! {
        #[test]
        fn every_reading_survives_the_way_out_and_back(counts in 0..=ADC_MAX) {
            for node in ALL {
                for channel in node.position.iter().chain(node.load.iter().flatten()) {
                    prop_assert_eq!(channel.counts(channel.value(counts).to_f32()), counts);
                }
            }
        }

        #[test]
        fn a_speed_is_met_within_half_a_count(speed in -8.0_f32..8.0) {
            for node in ALL {
                let full = node.full_speed.to_f32();
                let met = node.speed(node.command(Drive::Velocity(Q16::from_f32(speed)))).expect("not braked");
                let wanted = speed.clamp(-full, full);
                // Half a count, and the step of the command itself.
                let step = 0.51 * full / f32::from(PWM_PERIOD) + 1.0 / 65536.0;
                prop_assert!((met - wanted).abs() <= step, "{met} for {wanted}");
            }
        }
    }
}
