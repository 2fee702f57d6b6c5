//! Instructions of a memory, each decoded when it is first executed, and the places where a debugger wants to stop.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::cpu::decode::Op;

/// The decoded instructions of the memory that begins at `BASE`. Costs no emulated time, whatever it holds.
#[derive(Clone)]
pub(crate) struct Code<const BASE: u32> {
    /// The instruction that begins at each halfword; [`Op::Unknown`] if it was not executed yet, or is watched.
    ops: Box<[Op]>,
    /// Whole words around everything that is known.
    known: Range<u32>,
    /// Addresses at which execution halts, without the Thumb bit.
    watched: BTreeSet<u32>,
}

impl<const BASE: u32> Code<BASE> {
    /// Nothing known yet of `size` bytes.
    pub fn new(size: usize) -> Self {
        let ops = vec![Op::Unknown; size / 2].into_boxed_slice();
        Code { ops, known: BASE..BASE, watched: BTreeSet::new() }
    }

    /// The instruction at `pc`; `None` outside the memory.
    #[inline(always)]
    pub fn at(&self, pc: u32) -> Option<&Op> {
        self.ops.get((pc.wrapping_sub(BASE) >> 1) as usize)
    }

    /// Keeps what the instruction at `pc` is, until bytes of it change.
    pub fn keep(&mut self, pc: u32, op: Op) {
        if self.watched.contains(&pc) {
            return;
        }
        if let Some(place) = self.ops.get_mut((pc.wrapping_sub(BASE) >> 1) as usize) {
            *place = op;
            let (first, end) = (pc & !3, (pc & !3) + 8);
            self.known = match self.known.is_empty() {
                true => first..end,
                false => self.known.start.min(first)..self.known.end.max(end),
            };
        }
    }

    /// Whether an aligned write of at most a word to `address` may change what is known.
    #[inline(always)]
    pub fn is_known(&self, address: u32) -> bool {
        address.wrapping_sub(self.known.start) < self.known.end.wrapping_sub(self.known.start)
    }

    /// Bytes have changed. The halfword before may begin a 32-bit instruction.
    #[cold]
    pub fn forget(&mut self, address: u32, length: usize) {
        let at = address.wrapping_sub(BASE) as usize;
        let last = (at + length).div_ceil(2).min(self.ops.len());
        let first = (at / 2).saturating_sub(1).min(last);
        self.ops[first..last].fill(Op::Unknown);
    }

    /// Everything may have changed.
    pub fn forget_all(&mut self) {
        self.ops.fill(Op::Unknown);
        self.known = BASE..BASE;
    }

    /// Halts execution before the instruction at `pc`, or no longer.
    pub fn watch(&mut self, pc: u32, on: bool) {
        let pc = pc & !1;
        if self.at(pc).is_some() {
            match on {
                true => self.watched.insert(pc),
                false => self.watched.remove(&pc),
            };
            self.forget(pc, 2);
        }
    }

    /// Whether execution halts before the instruction at `pc`.
    pub fn is_watched(&self, pc: u32) -> bool {
        self.watched.contains(&pc)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BASE: u32 = 0x2000_0000;

    #[test]
    fn a_write_to_either_half_of_an_instruction_makes_it_unknown() {
        for written in [BASE + 0x10, BASE + 0x12] {
            let mut code = Code::<BASE>::new(0x100);
            code.keep(BASE + 0x10, Op::Nop);
            code.keep(BASE + 0x20, Op::Nop);
            assert!(code.is_known(written));
            code.forget(written, 2);
            assert_eq!((code.at(BASE + 0x10), code.at(BASE + 0x20)), (Some(&Op::Unknown), Some(&Op::Nop)));
        }
    }

    #[test]
    fn writes_beside_the_code_are_none_of_its_business() {
        let mut code = Code::<BASE>::new(0x100);
        assert!(!code.is_known(BASE));
        code.keep(BASE + 0x12, Op::Nop);
        assert!(!code.is_known(BASE + 0x0c) && code.is_known(BASE + 0x10));
        assert!(code.is_known(BASE + 0x14) && !code.is_known(BASE + 0x18));
    }

    #[test]
    fn a_watched_instruction_is_never_kept() {
        let mut code = Code::<BASE>::new(0x100);
        code.keep(BASE + 4, Op::Nop);
        code.watch(BASE + 5, true);
        code.keep(BASE + 4, Op::Nop);
        assert_eq!((code.at(BASE + 4), code.is_watched(BASE + 4)), (Some(&Op::Unknown), true));
        code.watch(BASE + 4, false);
        code.keep(BASE + 4, Op::Nop);
        assert_eq!(code.at(BASE + 4), Some(&Op::Nop));
    }

    #[test]
    fn outside_the_memory_there_is_nothing() {
        let mut code = Code::<BASE>::new(0x100);
        assert_eq!((code.at(BASE - 2), code.at(BASE + 0x100)), (None, None));
        code.watch(0x100, true);
        code.keep(0x100, Op::Nop);
        assert!(!code.is_watched(0x100));
    }
}
