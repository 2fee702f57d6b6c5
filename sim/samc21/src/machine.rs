//! Several chips on one clock.
//!
//! Time advances in slices of [`SLICE`]. In a slice every chip runs alone, in order; between slices an [`Exchange`]
//! moves what crosses between them and to the world: CAN frames, bytes, pin levels. So the order in which chips run
//! cannot be seen, and a run repeats exactly.

use crate::chip::{Chip, Stop};
use crate::time::Cycles;

/// Length of a slice in 48 MHz ticks: 10 µs. What one chip does reaches another no earlier than the next slice, so it
/// must be shorter than anything on the bus to which a chip may respond: the shortest CAN-FD frame takes 30 µs.
pub const SLICE: u64 = 480;

/// What happens between slices.
pub trait Exchange {
    /// All chips have run up to `now` (by at most one instruction beyond).
    fn exchange(&mut self, now: Cycles, chips: &mut [Chip]);
}

/// Chips that are not connected.
impl Exchange for () {
    fn exchange(&mut self, _now: Cycles, _chips: &mut [Chip]) {}
}

/// Chips with a common clock.
#[derive(Clone, Debug, Default)]
pub struct Machine {
    /// The chips, in the order in which they run.
    pub chips: Vec<Chip>,
    now: Cycles,
}

impl Machine {
    /// Chips that have all just been powered on.
    pub fn new(chips: Vec<Chip>) -> Self {
        Machine { chips, now: Cycles(0) }
    }

    /// Every chip has run at least up to here.
    pub fn now(&self) -> Cycles {
        self.now
    }

    /// Runs whole slices until `until` is reached, or until a chip stops; returns which, and why.
    ///
    /// The next call finishes the slice, first for the stopped chip, then for those after it.
    pub fn run_until(&mut self, until: Cycles, exchange: &mut impl Exchange) -> Option<(usize, Stop)> {
        while self.now < until {
            let end = Cycles((self.now.0 / SLICE + 1) * SLICE);
            for (index, chip) in self.chips.iter_mut().enumerate() {
                match chip.run_until(end) {
                    Stop::Time => {}
                    stop => return Some((index, stop)),
                }
            }
            self.now = end;
            exchange.exchange(end, &mut self.chips);
        }
        None
    }
}
