//! Whether everything that must live, lives: the watchdog is fed only if each part made progress since the last time.

use core::sync::atomic::{AtomicU32, Ordering};

/// A part's sign of life. Written by its part alone, so load and store need not be one step.
pub struct Pulse(AtomicU32);

impl Pulse {
    /// No beat yet.
    pub const fn new() -> Pulse {
        Pulse(AtomicU32::new(0))
    }

    /// Progress was made.
    pub fn beat(&self) {
        self.0.store(self.0.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
    }

    /// Beats so far; wraps.
    pub fn count(&self) -> u32 {
        self.0.load(Ordering::Relaxed)
    }
}

impl Default for Pulse {
    fn default() -> Pulse {
        Pulse::new()
    }
}

/// Judges `N` pulses together.
#[derive(Debug)]
pub struct Vitals<const N: usize> {
    seen: [u32; N],
}

impl<const N: usize> Vitals<N> {
    /// Nothing seen yet.
    pub const fn new() -> Vitals<N> {
        Vitals { seen: [0; N] }
    }

    /// Whether **every** part has made progress since this last said yes. A part that stands still is not made up for
    /// by the others.
    pub fn all_alive(&mut self, counts: [u32; N]) -> bool {
        let alive = self.seen.iter().zip(&counts).all(|(seen, count)| seen != count);
        if alive {
            self.seen = counts;
        }
        alive
    }
}

impl<const N: usize> Default for Vitals<N> {
    fn default() -> Self {
        Vitals::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_part_standing_still_starves_the_watchdog() {
        let (control, bus) = (Pulse::new(), Pulse::new());
        let mut vitals = Vitals::new();
        assert!(!vitals.all_alive([control.count(), bus.count()]));
        for _ in 0..5 {
            control.beat();
            assert!(!vitals.all_alive([control.count(), bus.count()]));
        }
        bus.beat();
        assert!(vitals.all_alive([control.count(), bus.count()]));
        bus.beat();
        assert!(!vitals.all_alive([control.count(), bus.count()]));
    }

    #[test]
    fn wrapping_is_progress() {
        let mut vitals = Vitals { seen: [u32::MAX] };
        assert!(vitals.all_alive([0]));
        assert!(!vitals.all_alive([0]));
    }
}
