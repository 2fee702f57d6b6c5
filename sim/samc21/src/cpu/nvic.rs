//! Pending, active and priority of exceptions (ARMv6-M ARM, B1.5 "Exception model" and B3.4 "NVIC").
//!
//! Exceptions have their architectural numbers: 2 NMI, 3 HardFault, 11 SVCall, 14 PendSV, 15 SysTick, 16 and up the
//! interrupt lines.

pub(crate) const NMI: u8 = 2;
pub(crate) const HARD_FAULT: u8 = 3;
pub(crate) const SVCALL: u8 = 11;
pub(crate) const PENDSV: u8 = 14;
pub(crate) const SYSTICK: u8 = 15;
pub(crate) const FIRST_IRQ: u32 = 16;

/// Priority of code that no exception interrupts: less urgent than any.
const THREAD: i16 = 256;

const fn bit(exception: u8) -> u64 {
    1 << exception
}

/// Exceptions that cannot be disabled.
const ALWAYS_ENABLED: u64 = bit(NMI) | bit(HARD_FAULT) | bit(SVCALL) | bit(PENDSV) | bit(SYSTICK);

/// State of all exceptions. Bit or index n is exception n.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Nvic {
    pending: u64,
    active: u64,
    enabled: u64,
    lines: u64,
    /// 0x00, 0x40, 0x80 or 0xc0: the Cortex-M0+ has two priority bits.
    priority: [u8; 48],
}

impl Default for Nvic {
    fn default() -> Self {
        Nvic { pending: 0, active: 0, enabled: ALWAYS_ENABLED, lines: 0, priority: [0; 48] }
    }
}

impl Nvic {
    /// Takes in the level of the interrupt lines; whether anything became pending.
    ///
    /// A level pends its interrupt unless it is active; a rising edge pends it in any case. Once pending, an interrupt
    /// stays so though its line falls.
    pub fn sample(&mut self, lines: u32) -> bool {
        let lines = u64::from(lines) << FIRST_IRQ;
        let before = self.pending;
        self.pending |= lines & (!self.lines | !self.active);
        self.lines = lines;
        self.pending & !before != 0
    }

    pub fn pend(&mut self, exception: u8) {
        self.pending |= bit(exception);
    }

    pub fn unpend(&mut self, exception: u8) {
        self.pending &= !bit(exception);
    }

    pub fn is_pending(&self, exception: u8) -> bool {
        self.pending & bit(exception) != 0
    }

    pub fn is_active(&self, exception: u8) -> bool {
        self.active & bit(exception) != 0
    }

    /// Whether any exception is active, other than `exception`.
    pub fn others_active(&self, exception: u8) -> bool {
        self.active & !bit(exception) != 0
    }

    pub fn activate(&mut self, exception: u8) {
        self.pending &= !bit(exception);
        self.active |= bit(exception);
    }

    pub fn deactivate(&mut self, exception: u8) {
        self.active &= !bit(exception);
    }

    /// Lower is more urgent.
    pub fn priority(&self, exception: u8) -> i16 {
        match exception {
            NMI => -2,
            HARD_FAULT => -1,
            _ => i16::from(self.priority[usize::from(exception) % 48]),
        }
    }

    /// Priority of what runs now, from the active exceptions alone.
    pub fn active_priority(&self) -> i16 {
        exceptions(self.active).map(|exception| self.priority(exception)).min().unwrap_or(THREAD)
    }

    /// Priority of what runs now, with PRIMASK (ARMv6-M ARM, B1.5.4 "ExecutionPriority").
    pub fn execution_priority(&self, primask: bool) -> i16 {
        match primask {
            true => self.active_priority().min(0),
            false => self.active_priority(),
        }
    }

    /// The most urgent exception that is pending and enabled; of equals the one with the lowest number.
    pub fn most_urgent(&self) -> Option<u8> {
        exceptions(self.pending & self.enabled).min_by_key(|exception| self.priority(*exception))
    }

    /// The interrupts' part of a register: enabled (ISER, ICER).
    pub fn irqs_enabled(&self) -> u32 {
        (self.enabled >> FIRST_IRQ) as u32
    }

    /// The interrupts' part of a register: pending (ISPR, ICPR).
    pub fn irqs_pending(&self) -> u32 {
        (self.pending >> FIRST_IRQ) as u32
    }

    pub fn enable_irqs(&mut self, mask: u32) {
        self.enabled |= u64::from(mask) << FIRST_IRQ;
    }

    pub fn disable_irqs(&mut self, mask: u32) {
        self.enabled &= !(u64::from(mask) << FIRST_IRQ);
    }

    pub fn pend_irqs(&mut self, mask: u32) {
        self.pending |= u64::from(mask) << FIRST_IRQ;
    }

    pub fn unpend_irqs(&mut self, mask: u32) {
        self.pending &= !(u64::from(mask) << FIRST_IRQ);
    }

    /// Four priorities from `exception` on, as IPRn and SHPRn show them.
    pub fn priorities(&self, exception: u32) -> u32 {
        let at = exception as usize % 48;
        u32::from_le_bytes([self.priority[at], self.priority[at + 1], self.priority[at + 2], self.priority[at + 3]])
    }

    /// Sets four priorities from `exception` on; only two bits of each exist.
    pub fn set_priorities(&mut self, exception: u32, value: u32) {
        let at = exception as usize % 48;
        for (priority, byte) in self.priority[at..at + 4].iter_mut().zip(value.to_le_bytes()) {
            *priority = byte & 0xc0;
        }
    }
}

/// The exceptions in a set, by number.
fn exceptions(mut set: u64) -> impl Iterator<Item = u8> {
    std::iter::from_fn(move || {
        let exception = (set != 0).then(|| set.trailing_zeros() as u8)?;
        set &= set - 1;
        Some(exception)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINE: u32 = 1 << 3;
    const EXCEPTION: u8 = 19;

    #[test]
    fn a_pulse_stays_pending() {
        let mut nvic = Nvic::default();
        assert!(nvic.sample(LINE));
        assert!(!nvic.sample(0));
        assert!(nvic.is_pending(EXCEPTION));
    }

    #[test]
    fn a_level_pends_again_when_its_handler_returns() {
        let mut nvic = Nvic::default();
        nvic.sample(LINE);
        nvic.activate(EXCEPTION);
        nvic.sample(LINE);
        assert!(!nvic.is_pending(EXCEPTION));
        nvic.deactivate(EXCEPTION);
        nvic.sample(LINE);
        assert!(nvic.is_pending(EXCEPTION));
    }

    #[test]
    fn a_level_pends_again_when_software_unpends_it() {
        let mut nvic = Nvic::default();
        nvic.sample(LINE);
        nvic.unpend_irqs(LINE);
        nvic.sample(LINE);
        assert!(nvic.is_pending(EXCEPTION));
    }

    #[test]
    fn a_second_edge_during_the_handler_pends() {
        let mut nvic = Nvic::default();
        nvic.sample(LINE);
        nvic.activate(EXCEPTION);
        nvic.sample(0);
        nvic.sample(LINE);
        assert!(nvic.is_pending(EXCEPTION));
    }

    #[test]
    fn of_equal_priorities_the_lowest_number_is_first() {
        let mut nvic = Nvic::default();
        nvic.enable_irqs(0xff);
        nvic.pend_irqs(0b1010);
        assert_eq!(nvic.most_urgent(), Some(17));
        nvic.set_priorities(16, 0x4040_4040);
        nvic.set_priorities(16, 0x0040_4040);
        assert_eq!(nvic.most_urgent(), Some(19));
    }

    #[test]
    fn only_two_priority_bits_exist() {
        let mut nvic = Nvic::default();
        nvic.set_priorities(16, 0xffff_ffff);
        assert_eq!(nvic.priorities(16), 0xc0c0_c0c0);
    }
}
