//! What all register blocks have in common: where registers lie, how wide they are, which bits exist, and how a write
//! reaches another clock domain (data sheet: "PAC", "Register Synchronization").
//!
//! An access may be narrower than its register, as the data sheet allows, but may not reach beyond it.

use crate::clocks::Hertz;
use crate::context::Context;
use crate::time::Cycles;
use crate::violation::Kind;
use crate::width::Width;

/// Who may do what.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Rule {
    ReadWrite,
    ReadOnly,
    WriteOnly,
}

/// A register, or several of a kind one after the other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Register {
    offset: u16,
    count: u16,
    width: Width,
    rule: Rule,
    /// Bits that may be written as one.
    bits: u32,
}

impl Register {
    /// Readable; of its bits `bits` may be written as one.
    pub(super) const fn new(offset: u32, width: Width, bits: u32) -> Register {
        Register { offset: offset as u16, count: 1, width, rule: Rule::ReadWrite, bits }
    }

    pub(super) const fn read_only(offset: u32, width: Width) -> Register {
        Register { rule: Rule::ReadOnly, ..Register::new(offset, width, 0) }
    }

    pub(super) const fn write_only(offset: u32, width: Width, bits: u32) -> Register {
        Register { rule: Rule::WriteOnly, ..Register::new(offset, width, bits) }
    }

    /// `count` of them, one after the other.
    pub(super) const fn times(self, count: u16) -> Register {
        Register { count, ..self }
    }
}

/// Which part of which register an access means.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Part {
    /// Offset of the register, of the first if there are several of a kind.
    pub(super) register: u32,
    /// Which of them.
    pub(super) index: usize,
    shift: u32,
    mask: u32,
    value: u32,
}

impl Part {
    /// What a read sees of the register's `value`.
    pub(super) const fn of(&self, value: u32) -> u32 {
        value >> self.shift
    }

    /// The bits written as one, where they stand in the register.
    pub(super) const fn ones(&self) -> u32 {
        self.value
    }

    /// The register after the write, if it held `old`.
    pub(super) const fn onto(&self, old: u32) -> u32 {
        old & !self.mask | self.value
    }
}

/// The registers of a block.
pub(super) struct Map(pub(super) &'static [Register]);

impl Map {
    /// The register a read means; `None` and a report if there is none, or none to read.
    #[inline]
    pub(super) fn read(&self, offset: u32, width: Width, ctx: &mut Context) -> Option<Part> {
        let (register, part) = self.find(offset, width, ctx)?;
        if register.rule == Rule::WriteOnly {
            ctx.report(Kind::WriteOnly);
            return None;
        }
        Some(part)
    }

    /// The register a write means; `None` and a report if there is none, or none to write. Reserved bits are reported
    /// and dropped.
    #[inline]
    pub(super) fn write(&self, offset: u32, width: Width, value: u32, ctx: &mut Context) -> Option<Part> {
        let (register, part) = self.find(offset, width, ctx)?;
        if register.rule == Rule::ReadOnly {
            ctx.report(Kind::ReadOnly);
            return None;
        }
        let value = (value & width.mask()) << part.shift;
        if value & !register.bits != 0 {
            ctx.report(Kind::ReservedBits(value & !register.bits));
        }
        Some(Part { value: value & register.bits, ..part })
    }

    #[inline]
    fn find(&self, offset: u32, width: Width, ctx: &mut Context) -> Option<(&'static Register, Part)> {
        let found = self.0.iter().find_map(|register| {
            let within = offset.wrapping_sub(u32::from(register.offset));
            let bytes = register.width.bytes();
            (within < bytes * u32::from(register.count)).then_some((register, within / bytes, within % bytes))
        });
        let Some((register, index, byte)) = found else {
            ctx.report(Kind::NoRegister);
            return None;
        };
        if byte + width.bytes() > register.width.bytes() {
            ctx.report(Kind::WrongWidth);
            return None;
        }
        let shift = 8 * byte;
        let mask = width.mask() << shift;
        Some((register, Part { register: register.offset.into(), index: index as usize, shift, mask, value: 0 }))
    }
}

/// A SYNCBUSY register: until when each of its bits is set.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(super) struct SyncBusy {
    until: [Cycles; 16],
    last: Cycles,
}

impl SyncBusy {
    /// The register.
    pub(super) fn bits(&self, now: Cycles) -> u32 {
        if self.last <= now {
            return 0;
        }
        let bit = |(n, until): (usize, &Cycles)| u32::from(*until > now) << n;
        self.until.iter().enumerate().map(bit).sum()
    }

    /// Starts synchronising `bit`, in `ticks`; returns when that is done.
    pub(super) fn start(&mut self, bit: u32, ticks: u64, now: Cycles) -> Cycles {
        let until = Cycles(now.0.saturating_add(ticks));
        if let Some(entry) = self.until.get_mut(bit as usize) {
            *entry = until;
        }
        self.last = self.last.max(until);
        until
    }

    /// Reports a write while one of `bits` is busy; `true` if so, and the write has no effect.
    pub(super) fn refuses(&self, bits: u32, ctx: &mut Context) -> bool {
        let refused = self.bits(ctx.now) & bits != 0;
        if refused {
            ctx.report(Kind::SyncBusy);
        }
        refused
    }
}

/// Ticks of `cycles` of a clock, rounded up; for ever if it does not run.
pub(super) fn ticks(cycles: u64, clock: Option<Hertz>) -> u64 {
    match clock {
        Some(Hertz(hertz)) if hertz != 0 => (cycles * Cycles::HZ).div_ceil(hertz.into()),
        _ => u64::MAX,
    }
}

/// Ticks until a write has crossed into a clock domain: the data sheet gives 5 to 6 of its cycles and 2 to 3 of the
/// bus; the longest is taken.
pub(super) fn crossing(clock: Option<Hertz>, ctx: &Context) -> u64 {
    ticks(6, clock).saturating_add(u64::from(3 * ctx.clocks.cpu_ticks))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAP: Map = Map(&[
        Register::new(0, Width::Word, 0xff0f),
        Register::read_only(4, Width::Byte),
        Register::write_only(5, Width::Byte, 0xff),
        Register::new(8, Width::Half, 0xffff).times(2),
    ]);

    fn kinds(ctx: &mut Context) -> Vec<Kind> {
        ctx.take_violations().into_iter().map(|violation| violation.kind).collect()
    }

    #[test]
    fn a_narrow_write_changes_its_bytes_alone() {
        let mut ctx = Context::default();
        let part = MAP.write(1, Width::Byte, 0xab, &mut ctx).expect("a register");
        assert_eq!((part.register, part.onto(0x12_3405), part.ones()), (0, 0x12_ab05, 0xab00));
        let part = MAP.read(1, Width::Byte, &mut ctx).expect("a register");
        assert_eq!(part.of(0x12_3456) & 0xff, 0x34);
        assert_eq!(kinds(&mut ctx), []);
    }

    #[test]
    fn what_the_block_does_not_have_is_reported() {
        let mut ctx = Context::default();
        assert!(MAP.write(4, Width::Byte, 1, &mut ctx).is_none());
        assert!(MAP.read(5, Width::Byte, &mut ctx).is_none());
        assert!(MAP.read(4, Width::Half, &mut ctx).is_none());
        assert!(MAP.read(6, Width::Byte, &mut ctx).is_none());
        assert_eq!(kinds(&mut ctx), [Kind::ReadOnly, Kind::WriteOnly, Kind::WrongWidth, Kind::NoRegister]);
    }

    #[test]
    fn reserved_bits_are_reported_and_dropped() {
        let mut ctx = Context::default();
        let part = MAP.write(0, Width::Word, 0x1_00f1, &mut ctx).expect("a register");
        assert_eq!(part.onto(0), 1);
        assert_eq!(kinds(&mut ctx), [Kind::ReservedBits(0x1_00f0)]);
    }

    #[test]
    fn registers_of_a_kind_are_numbered() {
        let mut ctx = Context::default();
        assert_eq!(MAP.read(10, Width::Half, &mut ctx).map(|part| (part.register, part.index)), Some((8, 1)));
        assert!(MAP.read(12, Width::Half, &mut ctx).is_none());
    }

    #[test]
    fn a_write_during_synchronisation_is_refused_until_it_is_over() {
        let mut ctx = Context::default();
        let mut sync = SyncBusy::default();
        sync.start(1, 10, ctx.now);
        assert_eq!(sync.bits(ctx.now), 2);
        assert!(sync.refuses(2, &mut ctx) && !sync.refuses(1, &mut ctx));
        ctx.now += 10;
        assert!(sync.bits(ctx.now) == 0 && !sync.refuses(2, &mut ctx));
        assert_eq!(kinds(&mut ctx), [Kind::SyncBusy]);
    }

    #[test]
    fn without_its_clock_a_write_never_arrives() {
        let mut ctx = Context::default();
        let mut sync = SyncBusy::default();
        sync.start(0, crossing(None, &ctx), ctx.now);
        ctx.now += 1 << 60;
        assert_eq!(sync.bits(ctx.now), 1);
    }
}
