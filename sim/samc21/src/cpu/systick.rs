//! SysTick (ARMv6-M ARM, B3.3): a 24-bit down-counter on the CPU clock.
//!
//! Counted lazily: only the time of the next zero is kept. There is no reference clock, so CLKSOURCE reads as one.

use crate::time::Cycles;

pub(crate) const ENABLE: u32 = 1 << 0;
pub(crate) const TICKINT: u32 = 1 << 1;
const CLKSOURCE: u32 = 1 << 2;
const COUNTFLAG: u32 = 1 << 16;
const COUNT: u32 = 0x00ff_ffff;

#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct SysTick {
    control: u32,
    reload: u32,
    flag: bool,
    /// The count while the counter stands.
    stopped_at: u32,
    /// When the running counter next reaches zero (or, from zero, would next reload): `None` while it stands.
    zero: Option<Cycles>,
    /// 48 MHz ticks per count.
    ticks: u64,
}

impl Default for SysTick {
    fn default() -> Self {
        SysTick { control: CLKSOURCE, reload: 0, flag: false, stopped_at: 0, zero: None, ticks: 1 }
    }
}

impl SysTick {
    /// SYST_CSR; reading clears COUNTFLAG.
    pub fn read_control(&mut self) -> u32 {
        let flag = std::mem::take(&mut self.flag);
        self.control | if flag { COUNTFLAG } else { 0 }
    }

    /// SYST_CSR.
    pub fn write_control(&mut self, value: u32, now: Cycles, ticks: u64) {
        let count = self.count(now);
        self.control = value & (ENABLE | TICKINT) | CLKSOURCE;
        self.ticks = ticks;
        self.restart(count, now);
    }

    /// SYST_RVR.
    pub fn reload(&self) -> u32 {
        self.reload
    }

    /// SYST_RVR. Takes effect when the counter next reloads.
    pub fn write_reload(&mut self, value: u32, now: Cycles) {
        let count = self.count(now);
        self.reload = value & COUNT;
        self.restart(count, now);
    }

    /// SYST_CVR.
    pub fn count(&self, now: Cycles) -> u32 {
        let Some(zero) = self.zero else { return self.stopped_at };
        let left = zero.since(now).div_ceil(self.ticks);
        // In the cycle after zero the count is still zero: the reload comes with the next one.
        if left == u64::from(self.reload) + 1 { 0 } else { left as u32 & COUNT }
    }

    /// SYST_CVR: any write clears the count and COUNTFLAG, without an exception.
    pub fn clear(&mut self, now: Cycles) {
        self.flag = false;
        self.restart(0, now);
    }

    /// When the counter next reaches zero.
    pub fn next_event(&self) -> Cycles {
        self.zero.unwrap_or(Cycles::NEVER)
    }

    /// The CPU clock is now `ticks` of 48 MHz per cycle.
    pub fn set_ticks(&mut self, ticks: u64, now: Cycles) {
        if self.ticks != ticks {
            let count = self.count(now);
            self.ticks = ticks;
            self.restart(count, now);
        }
    }

    /// Lets time pass up to `now`; whether the exception becomes pending.
    pub fn advance(&mut self, now: Cycles) -> bool {
        let mut pend = false;
        while let Some(zero) = self.zero.filter(|zero| *zero <= now) {
            self.flag = true;
            pend |= self.control & TICKINT != 0;
            self.zero = (self.reload != 0).then(|| zero + (u64::from(self.reload) + 1) * self.ticks);
            self.stopped_at = 0;
        }
        pend
    }

    /// From `count` on at `now`. From zero the counter first reloads, which sets no flag.
    fn restart(&mut self, count: u32, now: Cycles) {
        let to_zero = if count == 0 { self.reload + 1 } else { count };
        let runs = self.control & ENABLE != 0 && (count != 0 || self.reload != 0);
        self.stopped_at = count;
        self.zero = runs.then(|| now + u64::from(to_zero) * self.ticks);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn running(reload: u32) -> SysTick {
        let mut systick = SysTick::default();
        systick.write_reload(reload, Cycles(0));
        systick.clear(Cycles(0));
        systick.write_control(ENABLE | TICKINT, Cycles(0), 1);
        systick
    }

    #[test]
    fn the_period_is_one_more_than_the_reload_value() {
        let mut systick = running(999);
        assert!(!systick.advance(Cycles(999)));
        assert!(systick.advance(Cycles(1000)));
        assert!(!systick.advance(Cycles(1999)));
        assert!(systick.advance(Cycles(2000)));
    }

    #[test]
    fn it_counts_down_from_the_reload_value_through_zero() {
        let mut systick = running(9);
        let mut counts = vec![];
        for now in 0..13 {
            systick.advance(Cycles(now));
            counts.push(systick.count(Cycles(now)));
        }
        assert_eq!(counts, [0, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0, 9, 8]);
    }

    #[test]
    fn reading_control_clears_the_flag() {
        let mut systick = running(9);
        systick.advance(Cycles(10));
        assert_eq!(systick.read_control() & COUNTFLAG, COUNTFLAG);
        assert_eq!(systick.read_control() & COUNTFLAG, 0);
    }

    #[test]
    fn a_stopped_counter_keeps_its_count() {
        let mut systick = running(9);
        systick.write_control(0, Cycles(3), 1);
        assert_eq!(systick.count(Cycles(100)), 7);
        assert_eq!(systick.next_event(), Cycles::NEVER);
    }

    #[test]
    fn a_reload_value_of_zero_stops_it_at_zero() {
        let mut systick = running(9);
        systick.write_reload(0, Cycles(5));
        assert!(systick.advance(Cycles(10)));
        assert!(!systick.advance(Cycles(1000)));
        assert_eq!(systick.count(Cycles(1000)), 0);
    }
}
