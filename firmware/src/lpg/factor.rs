//! Factor and Step (paper, eq. 1 and 2) in fixed point.
//!
//! ```text
//! Factor = 1/(1 + 2^(A−5)) + 1/(1 + 3^(5−10·G))      A m/s² including gravity, G rad/s
//! Step   = 0.1/(1 + 5^(1−2·Factor))                  m
//! ```
//!
//! Both are sums of the logistic 1/(1+2^x). 2^−x comes from a table of 257 entries with linear interpolation (relative
//! error below 1e-6), the quotient from one short division, which suits the SAMC21's divider, and a Newton step. Error
//! against real arithmetic: below 2e-6 (tested over a fine grid).

use sarah_protocol::fixed::Q16;

use super::arithmetic::product;

/// Unsigned division: the only operation whose implementation differs between the chip (DIVAS) and elsewhere.
pub trait Divider {
    /// Quotient and remainder. `denominator` is never 0 here.
    fn divide(&self, numerator: u32, denominator: u32) -> (u32, u32);
}

/// Division as the compiler does it.
#[derive(Clone, Copy, Default, Debug)]
pub struct PlainDivider;

impl Divider for PlainDivider {
    fn divide(&self, numerator: u32, denominator: u32) -> (u32, u32) {
        match numerator.checked_div(denominator) {
            Some(quotient) => (quotient, numerator - quotient * denominator),
            // What DIVAS answers to a division by zero.
            None => (0, numerator),
        }
    }
}

/// Factor 0.07, above which a cycle may start (paper, Fig. 3), in Q30.
pub const FACTOR_THRESHOLD_Q30: u32 = 75_161_928;

const LOG2_3: f64 = 1.584_962_500_721_156;
const LOG2_5: f64 = 2.321_928_094_887_362;

/// `exp2(-i/256)` in Q30.
static EXP2_NEG: [u32; 257] = {
    let ratio = 0.997_296_056_085_470_1_f64; // 2^(-1/256)
    let mut table = [0; 257];
    let mut value = (1u64 << 30) as f64;
    let mut i = 0;
    while i < 257 {
        table[i] = (value + 0.5) as u32;
        value *= ratio;
        i += 1;
    }
    table
};

/// 2^−x in Q30 for x ≥ 0 in Q20.
fn exp2_neg(x: u32) -> u32 {
    let whole = x >> 20;
    if whole > 30 {
        return 0;
    }
    let index = ((x >> 12) & 0xff) as usize;
    let rest = x & 0xfff;
    let (Some(&high), Some(&low)) = (EXP2_NEG.get(index), EXP2_NEG.get(index + 1)) else {
        return 0;
    };
    // ((high − low) · rest) >> 12 in halves: 32 bits are one instruction, 64 a function call.
    let drop = high - low; // below 2^22
    (high - (((drop >> 10) * rest + (((drop & 0x3ff) * rest) >> 10)) >> 2)) >> whole
}

/// 1 − denominator · rough in Q31, rounded down: (2^47 − denominator · rough) >> 16, without a product of 64 bits. The
/// denominator is in Q30 from 1 to 2, rough in Q17 its reciprocal, from 2^16 to 2^17; so the result is small though its
/// parts wrap.
fn residual(denominator: u32, rough: u32) -> i32 {
    let (whole, fraction) = (denominator >> 16, denominator & 0xffff);
    // fraction · rough, divided by 2^16 and rounded up; rough without its leading bit keeps the product in 32 bits.
    let part = fraction + ((fraction * (rough - (1 << 16)) + 0xffff) >> 16);
    (1u32 << 31).wrapping_sub(whole.wrapping_mul(rough)).wrapping_sub(part) as i32
}

/// 1/(1+2^x) in Q30, x in Q20.
fn logistic<D: Divider>(divider: &D, x: i32) -> u32 {
    let denominator = (1 << 30) + exp2_neg(x.unsigned_abs()); // Q30, 1 to 2
    // A 15-bit division, then one Newton step s + s·(1 − d·s) squares its relative error of 6e-5.
    let rough = divider.divide(1 << 31, denominator >> 16).0; // Q17
    let residual = residual(denominator, rough);
    // rough · residual >> 18 in halves, as the residual is below 2^18.
    let correction = ((rough >> 8) as i32 * residual + (((rough & 0xff) as i32 * residual) >> 8)) >> 10;
    let above = ((rough << 13) as i32 + correction) as u32; // 1/(1+2^-|x|)
    if x < 0 { above } else { (1 << 30) - above }
}

/// Factor in Q30 (0 to 2), from acceleration in m/s² and rotation in rad/s.
pub fn factor<D: Divider>(divider: &D, acceleration: Q16, rotation: Q16) -> u32 {
    // Beyond these the logistics are saturated to all 30 bits; clamping keeps the exponents in Q20.
    let a = acceleration.0.clamp(0, 60 << 16);
    let g = rotation.0.clamp(0, 4 << 16);
    let fall = (a - (5 << 16)) << 4;
    const SLOPE: u32 = (10.0 * LOG2_3 * (1u64 << 24) as f64 + 0.5) as u32;
    const OFFSET: i32 = (5.0 * LOG2_3 * (1u64 << 20) as f64 + 0.5) as i32;
    // g · SLOPE >> 20, with SLOPE in halves of 14 bits: g is at most 2^18, so that neither product passes 32.
    let (high, low) = (SLOPE >> 14, SLOPE & 0x3fff);
    let turn = OFFSET - ((g as u32 * high + ((g as u32 * low) >> 14)) >> 6) as i32;
    logistic(divider, fall) + logistic(divider, turn)
}

/// Step height in Q30 metres (0 to 0.1) of a Factor in Q30.
pub fn step<D: Divider>(divider: &D, factor: u32) -> u32 {
    const SLOPE: u32 = (2.0 * LOG2_5 * (1u64 << 24) as f64 + 0.5) as u32;
    const OFFSET: i32 = (LOG2_5 * (1u64 << 20) as f64 + 0.5) as i32;
    let x = OFFSET - (product(factor, SLOPE).0 >> 2) as i32;
    const TENTH: u32 = (0.1 * (1u64 << 32) as f64 + 0.5) as u32;
    product(logistic(divider, x), TENTH).0
}

/// A Q30 number in Q16, rounded to nearest.
pub const fn q30_to_q16(value: u32) -> Q16 {
    Q16(((value >> 13) as i32 + 1) >> 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn factor_f64(a: f64, g: f64) -> f64 {
        1.0 / (1.0 + 2f64.powf(a - 5.0)) + 1.0 / (1.0 + 3f64.powf(5.0 - 10.0 * g))
    }
    fn step_f64(factor: f64) -> f64 {
        0.1 / (1.0 + 5f64.powf(1.0 - 2.0 * factor))
    }
    fn real(q30: u32) -> f64 {
        q30 as f64 / (1u64 << 30) as f64
    }

    /// As on paper, with 64 bits where they are needed.
    fn logistic_64(x: i32) -> u32 {
        let y = x.unsigned_abs();
        let power = match (EXP2_NEG.get((y >> 12 & 0xff) as usize), EXP2_NEG.get((y >> 12 & 0xff) as usize + 1)) {
            (Some(&high), Some(&low)) if y >> 20 <= 30 => {
                (high - ((u64::from(high - low) * u64::from(y & 0xfff)) >> 12) as u32) >> (y >> 20)
            }
            _ => 0,
        };
        let denominator = (1 << 30) + power;
        let rough = PlainDivider.divide(1 << 31, denominator >> 16).0;
        let residual = (1i64 << 47) - i64::from(denominator) * i64::from(rough);
        let above = ((rough << 13) as i32 + ((i64::from(rough) * (residual >> 16)) >> 18) as i32) as u32;
        if x < 0 { above } else { (1 << 30) - above }
    }

    proptest::proptest! {
        #[test]
        fn thirty_two_bits_give_what_sixty_four_give(x: i32, small in -(40 << 20)..40 << 20) {
            for x in [x, small, small >> 4, small >> 10] {
                proptest::prop_assert_eq!(logistic(&PlainDivider, x), logistic_64(x), "{}", x);
            }
        }

        #[test]
        fn factor_is_what_sixty_four_bits_give(a: i32, g: i32, shift in 0..32) {
            for (a, g) in [(a, g), (a >> shift, g >> 13), (a >> 9, g >> 14), (0, 4 << 16)] {
                let fall = (a.clamp(0, 60 << 16) - (5 << 16)) << 4;
                let slope = (10.0 * LOG2_3 * (1u64 << 24) as f64 + 0.5) as i64;
                let offset = (5.0 * LOG2_3 * (1u64 << 20) as f64 + 0.5) as i32;
                let turn = offset - ((i64::from(g.clamp(0, 4 << 16)) * slope) >> 20) as i32;
                let expected = logistic_64(fall) + logistic_64(turn);
                proptest::prop_assert_eq!(factor(&PlainDivider, Q16(a), Q16(g)), expected, "{} {}", a, g);
            }
        }
    }

    #[test]
    fn factor_and_step_agree_with_real_arithmetic_within_2e_6() {
        let mut worst = (0.0f64, 0.0f64);
        for ia in 0..700 {
            for ig in 0..400 {
                let a = Q16::from_f32(ia as f32 * 0.0571);
                let g = Q16::from_f32(ig as f32 * 0.010_3);
                let f = factor(&PlainDivider, a, g);
                let exact = factor_f64(a.0 as f64 / 65536.0, (g.0 as f64 / 65536.0).min(4.0));
                worst.0 = worst.0.max((real(f) - exact).abs());
                worst.1 = worst.1.max((real(step(&PlainDivider, f)) - step_f64(exact)).abs());
            }
        }
        assert!(worst.0 <= 2e-6 && worst.1 <= 2e-6, "worst errors {worst:?}");
    }

    #[test]
    fn at_rest_factor_is_below_the_threshold_and_a_push_is_above() {
        let rest = factor(&PlainDivider, Q16::lit(9.81), Q16::ZERO);
        assert!((real(rest) - 0.0385).abs() < 1e-3, "{}", real(rest));
        assert!(rest < FACTOR_THRESHOLD_Q30);
        assert!(factor(&PlainDivider, Q16::lit(8.7), Q16::ZERO) > FACTOR_THRESHOLD_Q30);
        assert!(factor(&PlainDivider, Q16::lit(9.81), Q16::lit(0.21)) > FACTOR_THRESHOLD_Q30);
    }

    #[test]
    fn step_runs_from_2_cm_at_the_threshold_to_8_cm_at_factor_one() {
        assert!((real(step(&PlainDivider, FACTOR_THRESHOLD_Q30)) - 0.020).abs() < 1e-3);
        assert!((real(step(&PlainDivider, 1 << 30)) - 0.0833).abs() < 1e-4);
    }

    #[test]
    fn extreme_inputs_stay_within_their_ranges() {
        for a in [i32::MIN, -1, 0, i32::MAX] {
            for g in [i32::MIN, -1, 0, i32::MAX] {
                let f = factor(&PlainDivider, Q16(a), Q16(g));
                assert!(f <= 2 << 30);
                assert!(real(step(&PlainDivider, f)) <= 0.1);
            }
        }
    }
}
