//! The clocks that run: published by the models of MCLK, OSCCTRL and GCLK, read by everybody else.

use crate::time::Cycles;
use crate::unit::{Mask, Unit};

/// A frequency in hertz.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default)]
pub struct Hertz(pub u32);

/// Number of generic clock channels (data sheet: GCLK, PCHCTRL).
pub const CHANNELS: usize = 41;

/// Number of clock generators (data sheet: GCLK, GENCTRL).
pub const GENERATORS: usize = 9;

/// A clock source of the generators (data sheet: GCLK, GENCTRL.SRC).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Source {
    /// The fast crystal.
    Xosc = 0,
    /// A pin.
    Pin = 1,
    /// Generator 1.
    Generator1 = 2,
    /// The ultra-low-power 32.768 kHz oscillator, which always runs.
    Osculp32k = 3,
    /// The internal 32.768 kHz oscillator.
    Osc32k = 4,
    /// The watch crystal.
    Xosc32k = 5,
    /// The internal 48 MHz oscillator.
    Osc48m = 6,
    /// The phase-locked loop.
    Dpll96m = 7,
}

/// Which clocks run, and how fast.
///
/// The values after [`Clocks::default`] are those after reset: OSC48M divided by 12 on the CPU, no generic clock.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Clocks {
    /// 48 MHz ticks per CPU cycle, at least one. CPU clocks that do not divide 48 MHz are rounded by the clock models.
    pub cpu_ticks: u32,
    /// MCLK.AHBMASK.
    pub ahb: u32,
    /// MCLK.APBAMASK, APBBMASK, APBCMASK.
    pub apb: [u32; 3],
    /// Frequency of each generic clock channel, `None` while it does not run (index: PCHCTRL number).
    pub generic: [Option<Hertz>; CHANNELS],
    /// Frequency of each source, `None` while it does not run (index: [`Source`]).
    pub sources: [Option<Hertz>; 8],
    /// Sources that enabled generators ask for, by the bit of their number.
    pub wanted_by_generators: u8,
    /// Sources that the phase-locked loop asks for, likewise.
    pub wanted_by_dpll: u8,
    /// Output of generator 0.
    pub main: Hertz,
    /// MCLK.CPUDIV.
    pub cpu_divider: u32,
}

impl Default for Clocks {
    fn default() -> Self {
        let mut sources = [None; 8];
        sources[Source::Osc48m as usize] = Some(Hertz(4_000_000));
        sources[Source::Osculp32k as usize] = Some(Hertz(32_768));
        Clocks {
            cpu_ticks: 12,
            ahb: 0x1cff,
            apb: [0x0fff, 0x0007, 0],
            generic: [None; CHANNELS],
            sources,
            wanted_by_generators: 1 << Source::Osc48m as u8,
            wanted_by_dpll: 0,
            main: Hertz(4_000_000),
            cpu_divider: 1,
        }
    }
}

impl Clocks {
    /// Frequency of the CPU.
    pub fn cpu(&self) -> Hertz {
        Hertz(self.main.0 / self.cpu_divider.max(1))
    }

    /// Recomputes [`Self::cpu_ticks`] after a change of generator 0 or the CPU's divider.
    pub(crate) fn set_cpu_ticks(&mut self) {
        let cpu = u64::from(self.cpu().0.max(1));
        self.cpu_ticks = ((Cycles::HZ + cpu / 2) / cpu).max(1) as u32;
    }

    /// Whether anybody asks for `source`.
    pub fn is_wanted(&self, source: Source) -> bool {
        (self.wanted_by_generators | self.wanted_by_dpll) >> source as u8 & 1 != 0
    }

    /// Frequency of a source, `None` while it does not run.
    pub fn source(&self, source: Source) -> Option<Hertz> {
        self.sources[source as usize]
    }

    /// Whether the bus interface of `unit` is clocked.
    pub fn bus_runs(&self, unit: Unit) -> bool {
        let Some((mask, bit)) = unit.clock_mask() else { return true };
        let register = match mask {
            Mask::Ahb => self.ahb,
            Mask::ApbA => self.apb[0],
            Mask::ApbB => self.apb[1],
            Mask::ApbC => self.apb[2],
        };
        register >> bit & 1 != 0
    }
}
