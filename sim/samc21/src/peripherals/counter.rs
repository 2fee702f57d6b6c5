//! The counter inside TC and TCC, without a step per count: where it stands and when it next passes a value follow
//! from when it started.
//!
//! It counts 0 to `top` and over again (down: `top` to 0). Flags of a value are set one count after the counter has
//! reached it (data sheet: TC, INTFLAG), so "passes" is that moment.

use crate::clocks::Hertz;
use crate::time::Cycles;

/// A counter that runs, or stands.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Counter {
    /// The value at `since`, seen as counting up: counting down it is mirrored.
    from: u64,
    since: Cycles,
    /// Counts since `since` already looked at.
    seen: u64,
    /// A count takes `num / den` ticks.
    num: u64,
    den: u64,
    top: u64,
    /// The largest value its width can hold.
    max: u64,
    down: bool,
    running: bool,
}

impl Default for Counter {
    fn default() -> Self {
        Counter {
            from: 0,
            since: Cycles(0),
            seen: 0,
            num: 1,
            den: 1,
            top: 0xffff,
            max: 0xffff,
            down: false,
            running: false,
        }
    }
}

const fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

impl Counter {
    /// Ticks per count from clock and prescaler, from `now` on; without a clock it stops.
    pub(super) fn set_clock(&mut self, clock: Option<Hertz>, prescaler: u64, now: Cycles) {
        self.set(self.value(now), now.max(self.since));
        let Some(clock) = clock else {
            self.running = false;
            return;
        };
        let (num, den) = (Cycles::HZ * prescaler, u64::from(clock.0.max(1)));
        let divisor = gcd(num, den);
        (self.num, self.den) = (num / divisor, den / divisor);
    }

    /// Ticks of a whole period.
    pub(super) fn period(&self) -> u64 {
        (self.top + 1) * self.num / self.den
    }

    /// Counts from `since` to `now`.
    fn counts(&self, now: Cycles) -> u64 {
        if !self.running {
            return 0;
        }
        let ticks = now.since(self.since);
        if self.den == 1 {
            ticks / self.num
        } else {
            (u128::from(ticks) * u128::from(self.den) / u128::from(self.num)) as u64
        }
    }

    /// When count number `n` happens.
    fn time_of(&self, n: u64) -> Cycles {
        let ticks = match self.den {
            1 => n.saturating_mul(self.num),
            den => u64::try_from((u128::from(n) * u128::from(self.num)).div_ceil(den.into())).unwrap_or(u64::MAX),
        };
        Cycles(self.since.0.saturating_add(ticks))
    }

    /// Where it stands after `n` counts, as counting up.
    fn position(&self, n: u64) -> u64 {
        if self.from <= self.top {
            return (self.from + n) % (self.top + 1);
        }
        // Beyond its top: on to the end of its width, and only then over.
        let over = self.max + 1 - self.from;
        if n < over { self.from + n } else { (n - over) % (self.top + 1) }
    }

    /// Mirrors a value of a counter that counts down.
    fn mirrored(&self, value: u64) -> u64 {
        if self.down { self.top.saturating_sub(value) } else { value }
    }

    /// Its value.
    pub(super) fn value(&self, now: Cycles) -> u64 {
        self.mirrored(self.position(self.counts(now)))
    }

    /// Changes how far and which way it counts; it goes on from where it stands, within the count it is in.
    pub(super) fn reshape(&mut self, top: u64, max: u64, down: bool, now: Cycles) {
        if (top, max, down) == (self.top, self.max, self.down) {
            return;
        }
        let counts = self.counts(now);
        let (value, since) = (self.mirrored(self.position(counts)), self.time_of(counts));
        (self.top, self.max, self.down) = (top, max, down);
        self.set(value, since);
    }

    /// Starts at `at`, from where it stands.
    pub(super) fn start(&mut self, at: Cycles) {
        self.set(self.value(at), at);
        self.running = true;
    }

    /// Stops where it stands.
    pub(super) fn stop(&mut self, at: Cycles) {
        self.set(self.value(at), at);
        self.running = false;
    }

    /// Whether it counts.
    pub(super) fn is_running(&self) -> bool {
        self.running
    }

    /// Stands at `value` from `at` on.
    pub(super) fn set(&mut self, value: u64, at: Cycles) {
        (self.from, self.since, self.seen) = (self.mirrored(value), at, 0);
    }

    /// The value at which a period begins.
    pub(super) fn start_value(&self) -> u64 {
        if self.down { self.top } else { 0 }
    }

    /// The count after `seen` at which it passes `value`.
    fn next_count(&self, value: u64) -> Option<u64> {
        if self.from > self.top {
            let over = self.max + 1 - self.from;
            if value >= self.from && value <= self.max && value - self.from + 1 > self.seen {
                return Some(value - self.from + 1);
            }
            if value > self.top {
                return None;
            }
            let period = self.top + 1;
            let first = over + value + 1;
            return Some(first + (self.seen + 1).saturating_sub(first).div_ceil(period) * period);
        }
        if value > self.top {
            return None;
        }
        let period = self.top + 1;
        let first = (value + period - self.from) % period + 1;
        Some(first + (self.seen + 1).saturating_sub(first).div_ceil(period) * period)
    }

    /// When it next passes `value` (as read, not mirrored); `None` if never.
    pub(super) fn next_pass(&self, value: u64) -> Option<Cycles> {
        if !self.running {
            return None;
        }
        self.next_count(self.mirrored(value)).map(|n| self.time_of(n))
    }

    /// When it next overflows, or underflows.
    pub(super) fn next_overflow(&self) -> Option<Cycles> {
        if !self.running {
            return None;
        }
        let last = if self.from > self.top { self.max } else { self.top };
        self.next_count(last).map(|n| self.time_of(n))
    }

    /// Everything up to `now` has been looked at.
    pub(super) fn look(&mut self, now: Cycles) {
        self.seen = self.counts(now);
        // Whole multiples of `den` counts take a whole number of ticks: from there it can start anew, exactly.
        let whole = self.seen - self.seen % self.den;
        if whole != 0 {
            self.from = self.position(whole);
            self.since = self.time_of(whole);
            self.seen -= whole;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counter(hertz: u32, prescaler: u64, top: u64) -> Counter {
        let mut counter = Counter { top, running: true, ..Counter::default() };
        counter.set_clock(Some(Hertz(hertz)), prescaler, Cycles(0));
        counter
    }

    #[test]
    fn it_counts_its_clock_divided_by_the_prescaler() {
        let counter = counter(16_000_000, 16, 0xffff);
        assert_eq!(counter.value(Cycles::from_micros(1234)), 1234);
        assert_eq!(counter.value(Cycles::from_micros(65536 + 7)), 7);
    }

    #[test]
    fn it_passes_its_top_once_a_period() {
        let mut counter = counter(48_000_000, 1, 4799);
        for n in 1..100 {
            assert_eq!(counter.next_overflow(), Some(Cycles(4800 * n)));
            assert_eq!(counter.next_pass(99), Some(Cycles(4800 * (n - 1) + 100)));
            counter.look(Cycles(4800 * n));
        }
    }

    #[test]
    fn a_value_beyond_the_top_is_never_passed() {
        assert_eq!(counter(48_000_000, 1, 99).next_pass(100), None);
    }

    #[test]
    fn beyond_its_top_it_runs_to_the_end_of_its_width() {
        let mut counter = counter(48_000_000, 1, 99);
        counter.set(0xfff0, Cycles(0));
        assert_eq!(counter.value(Cycles(15)), 0xffff);
        assert_eq!((counter.next_overflow(), counter.next_pass(5)), (Some(Cycles(16)), Some(Cycles(22))));
        assert_eq!(counter.value(Cycles(16 + 105)), 5);
        counter.look(Cycles(16));
        assert_eq!(counter.next_overflow(), Some(Cycles(116)));
    }

    #[test]
    fn downwards_it_is_its_mirror_image() {
        let mut counter = Counter { down: true, ..counter(48_000_000, 1, 99) };
        counter.set(counter.start_value(), Cycles(0));
        assert_eq!(counter.value(Cycles(10)), 89);
        assert_eq!((counter.next_pass(89), counter.next_overflow()), (Some(Cycles(11)), Some(Cycles(100))));
    }

    #[test]
    fn a_clock_that_does_not_divide_48_mhz_does_not_drift() {
        let mut counter = counter(32_768, 1, 0xffff);
        for millis in 1..10_000 {
            counter.look(Cycles::from_millis(millis));
        }
        assert_eq!(counter.value(Cycles::from_millis(10_000)), 327_680 % 65536);
    }
}
