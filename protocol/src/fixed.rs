//! Signed fixed point with 16 fractional bits: the number format of everything that ticks.
//!
//! The SAMC21 has no floating-point unit (a soft-float multiply is about 170 cycles), and integers agree bit for bit
//! on every machine. One step is 1/65536 ≈ 15 µm, 15 µrad, 15 µm/s; the range is ±32768. All operations saturate:
//! an overflow in a controller must never wrap into the opposite direction.

use core::ops::{Add, Neg, Sub};

use serde::{Deserialize, Serialize};

/// A number in steps of 2⁻¹⁶.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Debug, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Q16(pub i32);

impl Q16 {
    /// 0.
    pub const ZERO: Q16 = Q16(0);
    /// 1.
    pub const ONE: Q16 = Q16(1 << 16);
    /// The largest number, about 32768.
    pub const MAX: Q16 = Q16(i32::MAX);

    /// A constant from a decimal literal, rounded to nearest. For `const` items; the tick never touches floats.
    pub const fn lit(value: f64) -> Q16 {
        let scaled = value * 65536.0;
        Q16(if scaled < 0.0 { scaled - 0.5 } else { scaled + 0.5 } as i32)
    }

    /// Nearest step to `value`; saturates, and NaN becomes 0 (parameters are checked for NaN before they get here).
    pub fn from_f32(value: f32) -> Q16 {
        // In integers: it runs when a generation changes, within the tick, and the chip has no floating point.
        let bits = value.to_bits();
        let exponent = (bits >> 23 & 0xff) as i32;
        let fraction = u64::from(bits & 0x7f_ffff | 0x80_0000);
        // The value is fraction · 2^(exponent − 150).
        let half_steps = match exponent - 150 + 17 {
            // Infinity has no fraction, a NaN has.
            122.. if bits & 0x7f_ffff != 0 && exponent == 0xff => return Q16::ZERO,
            shift @ 0..=31 => fraction << shift,
            32.. => u64::MAX,
            shift @ -31..0 => fraction >> -shift,
            _ => 0,
        };
        let steps = half_steps / 2 + half_steps % 2;
        let signed = steps.min(1 << 31) as i64;
        Q16(saturate(if bits >> 31 == 1 { -signed } else { signed }))
    }

    /// The value as `f32`; exact up to 24 significant bits.
    pub fn to_f32(self) -> f32 {
        self.0 as f32 / 65536.0
    }

    /// Product, rounded to nearest, saturating.
    pub const fn times(self, other: Q16) -> Q16 {
        Q16(saturate((wide(self.0, other.0) + (1 << 15)) >> 16))
    }

    /// Product with a whole number of steps per unit: `self · numerator / 2^shift`, rounded down. For filter gains finer
    /// than 2⁻¹⁶.
    pub const fn scaled(self, numerator: i32, shift: u32) -> Q16 {
        Q16(saturate(wide(self.0, numerator) >> shift))
    }

    /// Magnitude; saturates at [`Q16::MAX`].
    pub const fn abs(self) -> Q16 {
        Q16(self.0.saturating_abs())
    }

    /// −1, 0 or 1.
    pub const fn signum(self) -> i32 {
        self.0.signum()
    }

    /// `self` with the sign of `sign` (as `-1`, `0` or `1`) applied.
    pub const fn signed(self, sign: i32) -> Q16 {
        if sign < 0 {
            Q16(self.0.saturating_neg())
        } else if sign > 0 {
            self
        } else {
            Q16::ZERO
        }
    }
}

/// The whole product. In halves: the chip multiplies 32 bits in one instruction, and calls a function of a hundred cycles
/// for 64.
#[inline(never)]
pub const fn wide(a: i32, b: i32) -> i64 {
    let (high_a, low_a) = (a >> 16, a & 0xffff);
    let (high_b, low_b) = (b >> 16, b & 0xffff);
    let low = (low_a as u32).wrapping_mul(low_b as u32);
    // Each below 2^31, and with what the low half carries still so.
    let middle = high_a * low_b + (low >> 16) as i32;
    let other = low_a * high_b + (middle & 0xffff);
    let high = high_a * high_b + (middle >> 16) + (other >> 16);
    (high as i64) << 32 | ((other as u32) << 16 | low & 0xffff) as i64
}

const fn saturate(wide: i64) -> i32 {
    if wide > i32::MAX as i64 {
        i32::MAX
    } else if wide < i32::MIN as i64 {
        i32::MIN
    } else {
        wide as i32
    }
}

impl Add for Q16 {
    type Output = Q16;
    fn add(self, other: Q16) -> Q16 {
        Q16(self.0.saturating_add(other.0))
    }
}

impl Sub for Q16 {
    type Output = Q16;
    fn sub(self, other: Q16) -> Q16 {
        Q16(self.0.saturating_sub(other.0))
    }
}

impl Neg for Q16 {
    type Output = Q16;
    fn neg(self) -> Q16 {
        Q16(self.0.saturating_neg())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_round_to_nearest_and_saturate() {
        assert_eq!(Q16::lit(1.5).times(Q16::lit(-2.0)), Q16::lit(-3.0));
        assert_eq!(Q16(1).times(Q16::lit(0.5)), Q16(1));
        assert_eq!(Q16::MAX.times(Q16::lit(2.0)), Q16::MAX);
        assert_eq!(Q16::MAX.times(Q16::lit(-2.0)), Q16(i32::MIN));
    }

    #[test]
    fn sums_saturate_instead_of_wrapping() {
        assert_eq!(Q16::MAX + Q16::ONE, Q16::MAX);
        assert_eq!(-Q16(i32::MIN), Q16::MAX);
    }

    #[test]
    fn floats_convert_to_the_nearest_step() {
        assert_eq!(Q16::from_f32(0.1), Q16::lit(0.1));
        assert_eq!(Q16::from_f32(f32::INFINITY), Q16::MAX);
        assert_eq!(Q16::from_f32(f32::NAN), Q16::ZERO);
        assert_eq!(Q16::from_f32(-0.25).to_f32(), -0.25);
    }

    proptest::proptest! {
        #[test]
        fn the_whole_product_is_whole(a: i32, b: i32, shift in 0..32) {
            for (a, b) in [(a, b), (a >> shift, b), (i32::MIN, a), (i32::MAX, b), (i32::MIN, i32::MIN), (-1, a >> shift)] {
                proptest::prop_assert_eq!(wide(a, b), i64::from(a) * i64::from(b));
            }
        }

        #[test]
        fn floats_convert_as_in_exact_arithmetic(bits: u32, near_one in -40_000.0_f32..40_000.0) {
            for value in [f32::from_bits(bits), near_one, near_one / 65536.0] {
                let scaled = f64::from(value) * 65536.0;
                let nearest = if scaled < 0.0 { scaled - 0.5 } else { scaled + 0.5 } as i32;
                proptest::prop_assert_eq!(Q16::from_f32(value).0, nearest, "{}", value);
            }
        }
    }
}
