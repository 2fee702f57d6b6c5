//! DIVAS as the divider of Factor and Step (data sheet: "DIVAS"): 32 by 32 bits in a few cycles, where the compiler's
//! division takes hundreds.
//!
//! The unit has one set of registers, so a division cut short by another would be wrong. There is one [`Divas`], owned
//! by the knee's ear, in the bus task; nothing else in an image divides with it.

use super::regs::divas::*;
use crate::lpg::factor::Divider;

/// The unit's registers, as far as a division needs them.
pub trait Unit {
    /// Sets the dividend.
    fn dividend(&mut self, value: u32);
    /// Sets the divisor, which starts the division.
    fn divisor(&mut self, value: u32);
    /// Division under way.
    fn busy(&mut self) -> bool;
    /// The quotient, rounded toward zero; 0 after a division by zero.
    fn quotient(&mut self) -> u32;
    /// The remainder; the dividend after a division by zero.
    fn remainder(&mut self) -> u32;
}

/// One division.
pub fn divide(unit: &mut impl Unit, numerator: u32, denominator: u32) -> (u32, u32) {
    unit.dividend(numerator);
    unit.divisor(denominator);
    while unit.busy() {}
    (unit.quotient(), unit.remainder())
}

impl Unit for MmioDivas<'_> {
    fn dividend(&mut self, value: u32) {
        self.write_dividend(value);
    }
    fn divisor(&mut self, value: u32) {
        self.write_divisor(value);
    }
    fn busy(&mut self) -> bool {
        self.read_status().busy()
    }
    fn quotient(&mut self) -> u32 {
        self.read_result()
    }
    fn remainder(&mut self) -> u32 {
        self.read_rem()
    }
}

/// The one divider of the chip.
#[derive(Debug)]
pub struct Divas(());

impl Divas {
    /// Sets the unit up for unsigned division.
    ///
    /// # Safety
    /// Call once, and divide at one interrupt priority only: the registers are shared.
    pub unsafe fn start() -> Divas {
        // SAFETY: nobody else uses the unit, see above. Its clock runs after reset.
        let mut unit = unsafe { super::regs::divas::Divas::new_mmio_at(DIVAS_IOBUS) };
        unit.write_ctrla(CtrlA::ZERO);
        Divas(())
    }
}

impl Divider for Divas {
    fn divide(&self, numerator: u32, denominator: u32) -> (u32, u32) {
        // SAFETY: this is the only user, by the contract of `start`.
        let mut unit = unsafe { super::regs::divas::Divas::new_mmio_at(DIVAS_IOBUS) };
        divide(&mut unit, numerator, denominator)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lpg::factor::PlainDivider;
    use proptest::prelude::*;

    /// The unit as the data sheet describes it: restoring division, one bit a step, busy meanwhile.
    #[derive(Default)]
    struct Model {
        dividend: u32,
        divisor: u32,
        quotient: u32,
        remainder: u32,
        steps_left: u32,
    }

    impl Unit for Model {
        fn dividend(&mut self, value: u32) {
            self.dividend = value;
        }
        fn divisor(&mut self, value: u32) {
            (self.divisor, self.quotient, self.remainder, self.steps_left) = (value, 0, 0, 32);
        }
        fn busy(&mut self) -> bool {
            if self.steps_left == 0 {
                return false;
            }
            self.steps_left -= 1;
            let shifted = u64::from(self.remainder) << 1 | u64::from(self.dividend >> self.steps_left & 1);
            let fits = self.divisor != 0 && shifted >= u64::from(self.divisor);
            self.remainder = (shifted - if fits { u64::from(self.divisor) } else { 0 }) as u32;
            self.quotient |= u32::from(fits) << self.steps_left;
            true
        }
        fn quotient(&mut self) -> u32 {
            assert_eq!(self.steps_left, 0, "read while busy");
            self.quotient
        }
        fn remainder(&mut self) -> u32 {
            assert_eq!(self.steps_left, 0, "read while busy");
            self.remainder
        }
    }

    proptest! {
        #[test]
        fn the_unit_divides_as_the_compiler_does(numerator: u32, denominator: u32, shift in 0_u32..32) {
            for denominator in [denominator, denominator >> shift, 0, 1, u32::MAX] {
                let ours = divide(&mut Model::default(), numerator, denominator);
                prop_assert_eq!(ours, PlainDivider.divide(numerator, denominator));
            }
        }
    }
}
