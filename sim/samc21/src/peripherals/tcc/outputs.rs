//! What the waveform outputs do, from the timer's settings.

use super::Tcc;
use super::registers::*;
use crate::context::Context;
use crate::wires::Pwm;

impl Tcc {
    /// Shows the outside what the outputs do.
    pub(super) fn publish(&self, ctx: &mut Context) {
        let period = self.counter.period();
        for (output, pwm) in ctx.wires.pwm[self.index].iter_mut().take(INSTANCES[self.index].3).enumerate() {
            *pwm = self.output(output, period);
        }
    }

    fn output(&self, output: usize, period: u64) -> Pwm {
        let level = |register: u32, bit: usize| register >> bit & 1 != 0;
        let faulted = self.is_faulted();
        if self.ctrla & ENABLE == 0 {
            return Pwm { faulted, ..Pwm::default() };
        }
        if !self.counter.is_running() {
            let (driven, high) = (level(self.drvctrl, output), level(self.drvctrl, 8 + output));
            return Pwm { duty: if high { 1.0 } else { 0.0 }, period: 0, driven, faulted };
        }
        let channels = INSTANCES[self.index].2;
        let channel = match self.wexctrl & 3 {
            0 => output % channels,
            1 => output % (channels / 2),
            2 => 0,
            _ => usize::from(output != 0),
        };
        let mut duty = match self.wave & 7 {
            NPWM => (self.cc[channel] as f32 / (self.per as f32 + 1.0)).min(1.0),
            // A frequency output toggles at the match.
            _ => 0.5,
        };
        if level(self.wave, 16 + channel) {
            duty = 1.0 - duty;
        }
        if level(self.patt, output) {
            duty = if level(self.patt, 8 + output) { 1.0 } else { 0.0 };
        }
        if level(self.drvctrl, 16 + output) {
            duty = 1.0 - duty;
        }
        Pwm { duty, period: u32::try_from(period).unwrap_or(u32::MAX), driven: true, faulted }
    }
}
