//! Where a joint is while it moves: reckoned from what it was told, not from what its sensor says.
//!
//! A sensor that is 60 ms late lets a leg at 0.9 m/s pass its goal by 54 mm; the speed of a geared actuator is known to a
//! few per cent. So a move counts from where the sensor saw the joint at rest, and the sensor is believed again when the
//! joint has rested for longer than sensors are late that are worth having.

use sarah_protocol::fixed::{Q16, wide};

use crate::lpg::Drive;

/// A joint that has rested for this long is where its sensor says.
pub const BELIEVED_AFTER_US: u32 = 100_000;

/// One joint.
#[derive(Clone, PartialEq, Debug)]
pub struct Place {
    at: Q16,
    /// What `at` leaves out, in 2⁻²⁰ of its steps.
    fraction: i32,
    /// What it was told in the last tick, rad/s or m/s; 0 is braked.
    speed: Q16,
    /// It has moved, or rested, for so long; stops at [`BELIEVED_AFTER_US`] of rest.
    since_us: u32,
}

impl Place {
    /// At rest.
    pub const fn resting() -> Place {
        Place { at: Q16::ZERO, fraction: 0, speed: Q16::ZERO, since_us: BELIEVED_AFTER_US }
    }

    /// Where it is.
    pub fn at(&self) -> Q16 {
        self.at
    }

    /// What its sensor says at the start of a tick. One that says nothing is not heard: the joint stays where it is reckoned.
    #[inline(always)]
    pub fn sense(&mut self, sensed: Q16) {
        if self.speed == Q16::ZERO && self.since_us >= BELIEVED_AFTER_US {
            self.at = sensed;
        }
    }

    /// `dt_us` have passed since the last tick; a move takes `gather_us` to gather speed, on average.
    #[inline(always)]
    pub fn advance(&mut self, dt_us: u32, gather_us: u32) {
        if self.speed != Q16::ZERO {
            self.travel(dt_us, gather_us);
        } else if self.since_us < BELIEVED_AFTER_US {
            self.since_us = self.since_us.saturating_add(dt_us);
        }
    }

    fn travel(&mut self, dt_us: u32, gather_us: u32) {
        let lost_us = dt_us.min(gather_us.saturating_sub(self.since_us));
        self.since_us = self.since_us.saturating_add(dt_us);
        let dt_us = (dt_us - lost_us).min(MAX_STEP_US) as i32;
        // 2^20 of those fractions per million µs: 1 + 3183/65536.
        let speed = self.speed.0;
        if dt_us < 1 << 10 && speed.unsigned_abs() < 8 << 16 {
            // The chip's own multiplications, at its tick rate.
            let sum = self.fraction + (speed + ((speed * 3183) >> 16)) * dt_us;
            self.at = Q16(self.at.0.wrapping_add(sum >> 20));
            self.fraction = sum & 0xF_FFFF;
        } else {
            let sum = i64::from(self.fraction) + wide((self.speed + self.speed.scaled(3183, 16)).0, dt_us);
            self.at = Q16(self.at.0.wrapping_add((sum >> 20) as i32));
            self.fraction = sum as i32 & 0xF_FFFF;
        }
    }

    /// End of a tick: what it is told until the next.
    #[inline]
    pub fn told(&mut self, drive: Drive) {
        let speed = match drive {
            Drive::Velocity(speed) => speed,
            Drive::Brake => Q16::ZERO,
        };
        if speed != self.speed {
            self.change(speed);
        }
    }

    fn change(&mut self, speed: Q16) {
        if self.speed == Q16::ZERO {
            self.fraction = 0;
        }
        if self.speed == Q16::ZERO || speed == Q16::ZERO {
            self.since_us = 0;
        }
        self.speed = speed;
    }
}

/// A longer gap between ticks counts as this much: the joint has reached its end by then.
const MAX_STEP_US: u32 = 1_000_000;

#[cfg(test)]
mod tests {
    use super::*;

    const RATES: [u32; 3] = [10_000, 1_000, 100];

    /// Ticks for `us` while told `drive`, with a sensor that says `sensed`.
    fn pass(place: &mut Place, dt_us: u32, us: u32, drive: Drive, sensed: Q16) {
        for _ in 0..us / dt_us {
            place.sense(sensed);
            place.advance(dt_us, 5_000);
            place.told(drive);
        }
    }

    #[test]
    fn a_move_is_reckoned_though_the_sensor_says_nothing_of_it() {
        for dt in RATES {
            for speed in [0.02, 0.9, -0.9, 5.0, -5.0] {
                let mut place = Place::resting();
                let (from, drive) = (Q16::lit(0.01), Drive::Velocity(Q16::lit(speed)));
                pass(&mut place, dt, dt, drive, from);
                pass(&mut place, dt, 100_000, drive, from);
                let expected = 0.01 + 0.095 * speed;
                assert!((f64::from(place.at().to_f32()) - expected).abs() < 1e-4, "{:?} at {dt} µs", place.at());
            }
        }
    }

    #[test]
    fn a_turn_within_a_move_is_reckoned_from_where_it_is() {
        let mut place = Place::resting();
        for speed in [-0.9, 0.8] {
            pass(&mut place, 1_000, 50_000, Drive::Velocity(Q16::lit(speed)), Q16::ZERO);
        }
        pass(&mut place, 1_000, 1_000, Drive::Brake, Q16::ZERO);
        assert!((place.at().to_f32() + 0.0005).abs() < 1e-3, "{:?}", place.at());
    }

    #[test]
    fn the_sensor_is_believed_again_after_a_rest() {
        for dt in RATES {
            let (mut place, seen) = (Place::resting(), Q16::lit(0.05));
            pass(&mut place, dt, 50_000, Drive::Velocity(Q16::lit(0.5)), Q16::ZERO);
            pass(&mut place, dt, 90_000, Drive::Brake, seen);
            assert!(place.at() < Q16::lit(0.03));
            pass(&mut place, dt, 40_000, Drive::Brake, seen);
            assert_eq!(place.at(), seen);
        }
    }

    proptest::proptest! {
        #[test]
        fn nothing_overflows(told: Vec<(i32, u32, i32)>) {
            let mut place = Place::resting();
            for (speed, dt_us, sensed) in told {
                place.sense(Q16(sensed));
                place.advance(dt_us, 5_000);
                place.told(Drive::Velocity(Q16(speed)));
            }
        }
    }
}
