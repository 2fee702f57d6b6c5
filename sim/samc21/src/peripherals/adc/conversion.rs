//! How long a conversion takes and what it gives (data sheet: "ADC", "Conversion Timing and Sampling Rate",
//! "Accumulation", "Averaging").

use super::*;

/// A conversion in progress.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Conversion {
    /// Input being converted.
    pub(super) input: u32,
    /// Inputs of the sequence still to come, by their bits.
    pub(super) rest: u32,
    /// When the result is ready.
    pub(super) done: Cycles,
}

impl Adc {
    /// Division of the generic clock.
    pub(super) fn prescaler(&self) -> u64 {
        2 << (self.get(CTRLB) & 7)
    }

    /// Result bits and the number of samples averaged, as a power of two.
    fn resolution(&self) -> (u32, u32) {
        let bits = match self.get(CTRLC) >> 4 & 3 {
            0 | 1 => 12,
            2 => 10,
            _ => 8,
        };
        (bits, (self.get(AVGCTRL) & 15).min(10))
    }

    /// Starts on the lowest of `inputs`; `None` without clock.
    pub(super) fn convert(&self, inputs: u32, at: Cycles, ctx: &Context) -> Option<Conversion> {
        let hertz = self.clock(ctx)?.0;
        let input = inputs.trailing_zeros();
        let (bits, samples) = self.resolution();
        let sampling = match self.get(SAMPCTRL) {
            // Offset compensation takes four cycles for itself.
            control if control & 1 << 7 != 0 => 4,
            control => (control & 0x3f) + 1,
        };
        // One cycle per bit and one to begin; the data sheet's figure for 12 bits single-ended is 13.
        let cycles = u64::from(sampling + bits + 1) << samples;
        let ticks = cycles * self.prescaler() * Cycles::HZ / u64::from(hertz.max(1));
        Some(Conversion { input, rest: inputs & (inputs - 1), done: at + ticks.max(1) })
    }

    /// Moves the conversion in progress behind `now`.
    pub(super) fn delay(&mut self, now: Cycles) {
        if let Some(conversion) = &mut self.conversion {
            conversion.done = now + 1;
        }
    }

    /// The count for the voltage on `input`.
    pub(super) fn count(&self, input: u32, ctx: &Context) -> u32 {
        let supply = ctx.wires.supply;
        let reference = match self.get(REFCTRL) & 15 {
            // SUPC.VREF at its reset value.
            0 => 1.024,
            1 => supply / 1.6,
            2 => supply / 2.0,
            _ => supply,
        };
        let volts = &ctx.wires.analog[self.index];
        let at = |input: u32| volts.get(input as usize).copied().unwrap_or(0.0);
        let (bits, samples) = self.resolution();
        let control = self.get(CTRLC);
        let full = (1_u32 << bits) as f32;
        // Nothing to compare with: full scale, as of a comparator that always says yes.
        let share = |volts: f32| if reference > 0.0 { volts / reference } else { 1.0 };
        let single = if control & C_DIFFMODE != 0 {
            let negative = match self.get(INPUTCTRL) >> 8 & 0x1f {
                input @ 0..=7 => at(input),
                _ => 0.0,
            };
            let half = full / 2.0;
            (share(at(input) - negative) * half).floor().clamp(-half, half - 1.0) as i32
        } else {
            (share(at(input)) * full).floor().clamp(0.0, full - 1.0) as i32
        };
        let mut value = single;
        if control & C_CORREN != 0 {
            let offset = (self.get(OFFSETCORR) as i32) << 20 >> 20;
            value = (value - offset) * self.get(GAINCORR) as i32 / 2048;
        }
        // Beyond 16 samples the sum is shifted to stay within 16 bits.
        value = value << samples >> samples.saturating_sub(4) >> (self.get(AVGCTRL) >> 4 & 7);
        if control & C_LEFTADJ != 0 {
            value <<= 16 - bits;
        }
        value as u32 & 0xffff
    }
}
