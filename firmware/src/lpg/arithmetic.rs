//! What the pattern generators reckon in every tick and of every message, on a chip that has no divider and multiplies 32
//! bits at once.

use sarah_protocol::fixed::Q16;

use super::rules;

/// Whether the vector (a, b) is longer than `limit`, from 0 to below [`LONGEST`].
pub fn longer(a: Q16, b: Q16, limit: Q16) -> bool {
    let (a, b, limit) = (a.0.unsigned_abs(), b.0.unsigned_abs(), limit.0 as u32);
    // Comparing squares needs no square root, and what is left to compare fits 32 bits.
    a > limit || b > limit || a * a + b * b > limit * limit
}

/// See [`longer`].
const LONGEST: Q16 = Q16::lit(0.5);
const _: () = assert!(rules::KNEE.chain_xi.0 < LONGEST.0 && rules::KNEE.fall_xi.0 < LONGEST.0);

/// The upper and the lower half of a · b. In halves itself: the chip multiplies 32 bits in one instruction, and calls a
/// function of a hundred cycles for 64.
pub const fn product(a: u32, b: u32) -> (u32, u32) {
    let (high_a, low_a) = (a >> 16, a & 0xffff);
    let (high_b, low_b) = (b >> 16, b & 0xffff);
    let low = low_a * low_b;
    // Neither passes 32 bits: the product of halves leaves room for what is carried.
    let middle = high_a * low_b + (low >> 16);
    let other = low_a * high_b + (middle & 0xffff);
    (high_a * high_b + (middle >> 16) + (other >> 16), other << 16 | low & 0xffff)
}

/// Whether `speed` covers `gap` within `lead_us`: gap ≤ speed · lead / 1 s, without a division.
pub fn covers(speed: Q16, lead_us: u32, gap: Q16) -> bool {
    const SECOND: i32 = 1_000_000;
    if gap.0 <= 0 {
        return true;
    }
    if gap.0 > i32::MAX / SECOND {
        return false;
    }
    // Below 4 m/s and 8 ms the product has 31 bits, one multiplication of the chip's.
    let (size, covered) = (speed.0 as u32, speed.0.wrapping_mul(lead_us as i32));
    let covered = if size < 1 << 18 && lead_us < 1 << 13 { covered } else { speed.scaled(lead_us as i32, 0).0 };
    gap.0 * SECOND <= covered
}

/// Whether `error` is at most half of what `speed` (0 to [`Q16::MAX`]) covers in `dt_us`: error ≤ speed · dt / 2 s, without
/// a division.
pub fn nearest(error: u32, speed: u32, dt_us: u32) -> bool {
    const TWO_SECONDS: u32 = 2_000_000;
    // What ticks of up to 2 ms and speeds below 16 rad/s give fits 32 bits; the chip is ten times slower at 64.
    if dt_us < 1 << 11 && speed < 1 << 20 {
        return error <= u32::MAX / TWO_SECONDS && error * TWO_SECONDS <= speed * dt_us;
    }
    u64::from(error) * u64::from(TWO_SECONDS) <= u64::from(speed) * u64::from(dt_us)
}

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

        #[test]
        fn covers_is_a_division(gap: i32, speed: i32, shift in 0..32, lead_us in 0..20_000_u32) {
            for (gap, speed) in [(gap, speed), (gap >> 20, speed >> shift), ((speed >> 13) / 200, speed >> 13)] {
                let exact = i64::from(gap) * 1_000_000 <= i64::from(speed) * i64::from(lead_us);
                let expected = gap <= 0 || gap <= i32::MAX / 1_000_000 && exact;
                proptest::prop_assert_eq!(covers(Q16(speed), lead_us, Q16(gap)), expected, "{} {}", gap, speed);
            }
        }

        #[test]
        fn nearest_is_a_division(
            error in 0..=i32::MAX as u32,
            speed in 0..=i32::MAX as u32,
            dt_us in 0..=2_000_000_u32,
            shift in 0..32,
        ) {
            for (error, speed, dt_us) in [
                (error, speed, dt_us),
                (error >> shift, speed >> 11, dt_us >> 10),
                (error >> 20, speed >> 11, dt_us >> 10),
                ((u64::from(speed >> 11) * u64::from(dt_us >> 10) / 2_000_000) as u32, speed >> 11, dt_us >> 10),
            ] {
                let near = (i64::from(speed) * i64::from(dt_us) / 2_000_000) as i32;
                proptest::prop_assert_eq!(nearest(error, speed, dt_us), error as i32 <= near);
            }
        }
    }
}
