//! Where a joint is while it moves: reckoned from what it was told, not from what its sensor says.
//!
//! A sensor that is 60 ms late lets a leg at 0.9 m/s pass its goal by 54 mm; the speed of a geared actuator is known to a
//! few per cent. So a move counts from where the sensor saw the joint at rest, and the sensor is believed again when the
//! joint has rested for longer than it can be late.

use sarah_protocol::fixed::{Q16, wide};

use crate::lpg::Drive;

/// A joint that has rested for this long is where its sensor says.
pub const BELIEVED_AFTER_US: u32 = 100_000;

/// One joint.
#[derive(Clone, PartialEq, Debug)]
pub struct Place {
    at: Q16,
    /// The same, Q36: a tick adds less than a step of `at`.
    fine: i64,
    /// What it was told in the last tick, rad/s or m/s; 0 is braked.
    speed: Q16,
    /// `speed` in Q36 per µs.
    per_us: i32,
    /// It has rested for so long; stops at [`BELIEVED_AFTER_US`].
    rest_us: u32,
    /// What is left of the time it takes to gather speed, and all of it.
    gather_us: (u32, u32),
}

impl Place {
    /// At rest; takes `gather_us` of a move to gather speed, on average.
    pub const fn new(gather_us: u32) -> Place {
        Place {
            at: Q16::ZERO,
            fine: 0,
            speed: Q16::ZERO,
            per_us: 0,
            rest_us: BELIEVED_AFTER_US,
            gather_us: (gather_us, gather_us),
        }
    }

    /// Where it is.
    pub fn at(&self) -> Q16 {
        self.at
    }

    /// It is where its sensor says.
    pub fn rests(&self) -> bool {
        (self.speed == Q16::ZERO) & (self.rest_us >= BELIEVED_AFTER_US)
    }

    /// Start of a tick, `dt_us` after the last.
    #[inline]
    pub fn advance(&mut self, dt_us: u32, sensed: Q16) {
        if self.speed != Q16::ZERO {
            self.travel(dt_us);
        } else if self.rest_us >= BELIEVED_AFTER_US {
            self.at = sensed;
        } else {
            self.rest_us = self.rest_us.saturating_add(dt_us);
        }
    }

    fn travel(&mut self, dt_us: u32) {
        let lost_us = dt_us.min(self.gather_us.0);
        self.gather_us.0 -= lost_us;
        let dt_us = (dt_us - lost_us).min(MAX_STEP_US) as i32;
        // One multiplication of the chip's at its tick rate, below 8 rad/s.
        let small = dt_us < 1 << 10 && self.per_us.unsigned_abs() < 1 << 20;
        self.fine += if small { i64::from(self.per_us * dt_us) } else { wide(self.per_us, dt_us) };
        self.at = Q16((self.fine >> 20) as i32);
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
            self.fine = i64::from(self.at.0) << 20;
            self.gather_us.0 = self.gather_us.1;
        }
        self.speed = speed;
        // 2^20 steps per million µs: 1 + 3183/65536.
        self.per_us = (speed + speed.scaled(3183, 16)).0;
        self.rest_us = 0;
    }
}

/// A longer gap between ticks counts as this much.
const MAX_STEP_US: u32 = 20_000;

#[cfg(test)]
mod tests {
    use super::*;

    const RATES: [u32; 3] = [10_000, 1_000, 100];

    /// Ticks for `us` while told `drive`, with a sensor that says `sensed`.
    fn pass(place: &mut Place, dt_us: u32, us: u32, drive: Drive, sensed: Q16) {
        for _ in 0..us / dt_us {
            place.advance(dt_us, sensed);
            place.told(drive);
        }
    }

    #[test]
    fn a_move_is_reckoned_though_the_sensor_says_nothing_of_it() {
        for dt in RATES {
            for speed in [0.02, 0.9, -0.9, 5.0, -5.0] {
                let mut place = Place::new(5_000);
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
        let mut place = Place::new(0);
        for speed in [-0.9, 0.8] {
            pass(&mut place, 1_000, 50_000, Drive::Velocity(Q16::lit(speed)), Q16::ZERO);
        }
        pass(&mut place, 1_000, 1_000, Drive::Brake, Q16::ZERO);
        assert!((place.at().to_f32() + 0.005).abs() < 1e-3, "{:?}", place.at());
    }

    #[test]
    fn the_sensor_is_believed_again_after_a_rest() {
        for dt in RATES {
            let (mut place, seen) = (Place::new(0), Q16::lit(0.05));
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
            let mut place = Place::new(5_000);
            for (speed, dt_us, sensed) in told {
                place.advance(dt_us, Q16(sensed));
                place.told(Drive::Velocity(Q16(speed)));
            }
        }
    }
}
