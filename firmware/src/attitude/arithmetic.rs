//! Products, quotients and roots of the attitude filter, without a 64-bit multiplication or division: the chip calls a
//! function of a hundred cycles for the one and of a thousand for the other.

use sarah_protocol::fixed::wide;

use super::MAX_STEP_US;

/// `a · b`. Quick if `a` fits into 32 bits, as it does unless the samples are nonsense.
pub fn times(a: i64, b: i32) -> i64 {
    match i32::try_from(a) {
        Ok(a) => wide(a, b),
        Err(_) => a * i64::from(b),
    }
}

/// `a²`, likewise.
pub fn square(a: i64) -> i64 {
    match i32::try_from(a) {
        Ok(a) => wide(a, a),
        Err(_) => a * a,
    }
}

/// A sixth, rounded towards zero, of a number of less than 2³².
pub fn sixth(value: i64) -> i64 {
    let half = (value.unsigned_abs() >> 1) as i32;
    let quotient = i64::from(THIRD.of(half));
    if value < 0 { -quotient } else { quotient }
}

/// One n-th, from a third down, by its reciprocal.
#[derive(Clone, Copy, Debug)]
pub struct Part(i32);

impl Part {
    const fn one(n: u32) -> Part {
        Part((u32::MAX / n + 1) as i32)
    }

    /// Rounded down, of a number from 0 to below 2³⁰, of a third to below 2³¹: then the rounding of the reciprocal does not
    /// show.
    pub fn of(self, value: i32) -> i32 {
        (wide(value, self.0) >> 32) as i32
    }
}

const THIRD: Part = Part::one(3);

/// From a seventh to a third.
pub const SEVENTH_TO_THIRD: [Part; 5] = [Part::one(7), Part::one(6), Part::one(5), Part::one(4), THIRD];

/// A time by which shorter ones are divided, as the 48 bits of 2⁶² / τ.
#[derive(Clone, Copy, Debug)]
pub struct TimeConstant([u32; 3]);

impl TimeConstant {
    pub const fn us(tau_us: u64) -> TimeConstant {
        let per_us = (1 << 62) / tau_us + 1;
        assert!(per_us >> 48 == 0);
        TimeConstant([(per_us & 0xffff) as u32, (per_us >> 16 & 0xffff) as u32, (per_us >> 32) as u32])
    }

    /// dt/τ in Q30, rounded down, for at most [`MAX_STEP_US`].
    pub fn share(self, dt_us: u32) -> i32 {
        const { assert!(MAX_STEP_US < 1 << 15) };
        let [low, middle, high] = self.0;
        let carry = dt_us * middle + ((dt_us * low) >> 16);
        (dt_us * high + (carry >> 16)) as i32
    }
}

/// √value in steps of 2⁻⁸, rounded down: bit by bit, two of the operand at a time.
pub fn root(value: u32) -> i32 {
    let (mut root, mut rest, mut left) = (0_u32, 0_u32, value);
    for _ in 0..24 {
        rest = rest << 2 | left >> 30;
        left <<= 2;
        let trial = root << 2 | 1;
        root <<= 1;
        if rest >= trial {
            rest -= trial;
            root |= 1;
        }
    }
    root as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn shares_of_a_time_constant_are_rounded_down() {
        for tau in [500_000, 50_000, 21_200] {
            let constant = TimeConstant::us(tau);
            for dt_us in 0..=MAX_STEP_US {
                assert_eq!(constant.share(dt_us) as u64, (u64::from(dt_us) << 30) / tau, "{dt_us} of {tau}");
            }
        }
    }

    proptest! {
        #[test]
        fn parts_are_quotients(value: u32, negative: bool) {
            for (part, n) in SEVENTH_TO_THIRD.into_iter().zip((3..=7).rev()) {
                for value in [value >> 2, (1 << 30) - 1, value % 1000] {
                    prop_assert_eq!(part.of(value as i32), value as i32 / n);
                }
            }
            for value in [i64::from(value), i64::from(u32::MAX), i64::from(value % 1000)] {
                let value = if negative { -value } else { value };
                prop_assert_eq!(sixth(value), value / 6);
            }
        }

        #[test]
        fn roots_are_rounded_down(value: u32, small in 0_u32..100_000) {
            for value in [value, small, 0, u32::MAX] {
                prop_assert_eq!(root(value) as u64, (u64::from(value) << 16).isqrt());
            }
        }

        #[test]
        fn products_are_whole(a in -(1_i64 << 33)..1 << 33, small: i32, b in -(1 << 29)..1 << 29) {
            for a in [a, i64::from(small), i64::from(i32::MIN), i64::from(i32::MAX)] {
                prop_assert_eq!(times(a, b), a * i64::from(b));
            }
            prop_assert_eq!(square(i64::from(small)), i64::from(small) * i64::from(small));
        }
    }
}
