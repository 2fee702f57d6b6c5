//! Where the time goes: awake 48 MHz ticks by function.

use crate::cpu::Observer;
use crate::symbols::Symbols;

/// Ticks spent in each function of an image.
#[derive(Clone, Debug)]
pub struct Profile {
    symbols: Symbols,
    ticks: Vec<u64>,
    elsewhere: u64,
    /// The function around the last instruction, as a range of addresses and an index: most instructions stay in it.
    current: (std::ops::Range<u32>, Option<usize>),
}

impl Profile {
    /// Starts from zero.
    pub fn new(symbols: Symbols) -> Self {
        let ticks = vec![0; symbols.all().len()];
        Profile { symbols, ticks, elsewhere: 0, current: (0..0, None) }
    }

    /// Name and awake ticks of every function that ran, most expensive first. Code outside all functions is `?`.
    pub fn functions(&self) -> Vec<(&str, u64)> {
        let named = self.symbols.all().iter().zip(&self.ticks).map(|(symbol, ticks)| (symbol.name.as_str(), *ticks));
        let mut all: Vec<_> = named.chain([("?", self.elsewhere)]).filter(|(_, ticks)| *ticks != 0).collect();
        all.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(b.0)));
        all
    }

    /// Back to zero.
    pub fn clear(&mut self) {
        self.ticks.fill(0);
        self.elsewhere = 0;
    }

    #[cold]
    fn look_up(&mut self, pc: u32) {
        let index = self.symbols.index(pc);
        let range = match index.map(|index| &self.symbols.all()[index]) {
            Some(symbol) if symbol.size != 0 => symbol.address..symbol.address + symbol.size,
            _ => pc..pc + 1,
        };
        self.current = (range, index);
    }
}

impl Observer for Profile {
    #[inline]
    fn executed(&mut self, pc: u32, ticks: u64) {
        if !self.current.0.contains(&pc) {
            self.look_up(pc);
        }
        match self.current.1 {
            Some(index) => self.ticks[index] += ticks,
            None => self.elsewhere += ticks,
        }
    }
}
