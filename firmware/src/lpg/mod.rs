//! The local pattern generators: small white-box state machines, one per pair of joints.
//!
//! - [`knee`]: LPG1, linear actuators; owns the cycle and raises the flags (paper, Fig. 3).
//! - [`swing`]: LPG2 (hips) and LPG3 (abductors); one rule, two sets of numbers, driven by the flags (Fig. 2).
//! - [`fall`]: what LPG1 reads from the IMU. [`factor`]: eq. 1 and 2 in fixed point.
//! - [`rules`]: the constants that are not trained.
//!
//! All are pure: `tick(inputs) -> outputs`, integers only, no allocation, bounded time, and no behaviour that depends on
//! the tick rate beyond sampling.

pub mod factor;
pub mod fall;
pub mod knee;
pub mod rules;
pub mod swing;

use sarah_protocol::fixed::Q16;

/// What an actuator is told. Power is drawn, and the brake coil energised, only by [`Drive::Velocity`].
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Drive {
    /// Brake engaged, motor off: holds without power.
    #[default]
    Brake,
    /// Brake released, moving at this speed: m/s or rad/s.
    Velocity(Q16),
}

/// Whether the vector (a, b) is longer than `limit`, from 0 to below [`LONGEST`].
fn longer(a: Q16, b: Q16, limit: Q16) -> bool {
    let (a, b, limit) = (a.0.unsigned_abs(), b.0.unsigned_abs(), limit.0 as u32);
    // Comparing squares needs no square root, and what is left to compare fits 32 bits.
    a > limit || b > limit || a * a + b * b > limit * limit
}

/// The upper and the lower half of a · b. In halves itself: the chip multiplies 32 bits in one instruction, and calls a
/// function of a hundred cycles for 64.
pub(crate) const fn product(a: u32, b: u32) -> (u32, u32) {
    let (high_a, low_a) = (a >> 16, a & 0xffff);
    let (high_b, low_b) = (b >> 16, b & 0xffff);
    let low = low_a * low_b;
    // Neither passes 32 bits: the product of halves leaves room for what is carried.
    let middle = high_a * low_b + (low >> 16);
    let other = low_a * high_b + (middle & 0xffff);
    (high_a * high_b + (middle >> 16) + (other >> 16), other << 16 | low & 0xffff)
}

/// See [`longer`].
const LONGEST: Q16 = Q16::lit(0.5);
const _: () = assert!(rules::KNEE.chain_xi.0 < LONGEST.0 && rules::KNEE.fall_xi.0 < LONGEST.0);

#[cfg(test)]
mod tests {
    use super::*;

    proptest::proptest! {
        #[test]
        fn a_product_in_halves_is_the_product(a: u32, b: u32, shift in 0..32) {
            for (a, b) in [(a, b), (a >> shift, b), (u32::MAX, u32::MAX), (a, u32::MAX)] {
                let (high, low) = product(a, b);
                proptest::prop_assert_eq!(u64::from(high) << 32 | u64::from(low), u64::from(a) * u64::from(b));
            }
        }

        #[test]
        fn longer_is_a_comparison_of_lengths(a: i32, b: i32, shift in 0..20, limit in 0..LONGEST.0) {
            for (a, b) in [(a, b), (a >> 16, b >> shift), (a >> 17, b >> 17), (limit, 0), (0, -limit), (limit, 1)] {
                let squared = i128::from(a).pow(2) + i128::from(b).pow(2);
                let expected = squared > i128::from(limit).pow(2);
                proptest::prop_assert_eq!(longer(Q16(a), Q16(b), Q16(limit)), expected, "{} {} {}", a, b, limit);
            }
        }
    }
}
