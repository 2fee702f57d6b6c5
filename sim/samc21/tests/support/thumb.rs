//! Thumb instructions by name, and chips with a few of them in flash.

#![allow(dead_code, reason = "each test file uses some")]

use samc21::{Chip, Cycles, Image, Stop};

/// Where the main program lies.
pub const MAIN: u32 = 0x200;
/// Initial main stack pointer.
pub const STACK: u32 = 0x2000_2000;

pub const NOP: u16 = 0xbf00;
pub const WFE: u16 = 0xbf20;
pub const WFI: u16 = 0xbf30;
pub const SEV: u16 = 0xbf40;
pub const CPSID: u16 = 0xb672;
pub const CPSIE: u16 = 0xb662;
pub const BKPT: u16 = 0xbe00;
pub const SVC: u16 = 0xdf00;
pub const UDF: u16 = 0xde00;
pub const BX_LR: u16 = 0x4770;
/// Branch to itself.
pub const SPIN: u16 = 0xe7fe;
/// MRS Rd is `[MRS, mrs(d, special)]`.
pub const MRS: u16 = 0xf3ef;
/// Second halfword of MSR.
pub const fn msr(special: u16) -> u16 {
    0x8800 | special
}
/// First halfword of MSR.
pub const fn msr_from(n: u16) -> u16 {
    0xf380 | n
}
/// Second halfword of MRS.
pub const fn mrs(d: u16, special: u16) -> u16 {
    0x8000 | d << 8 | special
}
/// MOVS Rd, #imm
pub const fn movs(d: u16, imm: u16) -> u16 {
    0x2000 | d << 8 | imm
}
/// ADDS Rd, #imm
pub const fn adds(d: u16, imm: u16) -> u16 {
    0x3000 | d << 8 | imm
}
/// LSLS Rd, Rm, #shift
pub const fn lsls(d: u16, m: u16, shift: u16) -> u16 {
    shift << 6 | m << 3 | d
}
/// STR Rt, [Rn, #offset]
pub const fn str(t: u16, n: u16, offset: u16) -> u16 {
    0x6000 | (offset / 4) << 6 | n << 3 | t
}
/// LDR Rt, [Rn, #offset]
pub const fn ldr(t: u16, n: u16, offset: u16) -> u16 {
    0x6800 | (offset / 4) << 6 | n << 3 | t
}
/// BX Rm
pub const fn bx(m: u16) -> u16 {
    0x4700 | m << 3
}

/// A handler that appends the digit `n` to the hexadecimal number in R7 and returns. Exception entry does not save R7.
pub const fn note(n: u16) -> [u16; 3] {
    [lsls(7, 7, 4), adds(7, n), BX_LR]
}

/// Flash contents being put together.
pub struct Program {
    flash: Vec<u8>,
}

impl Program {
    /// `main` at [`MAIN`], entered from reset; every exception spins.
    pub fn new(main: &[u16]) -> Self {
        let mut program = Program { flash: vec![0xff; 0x2000] };
        program.word(0, STACK);
        program.at(MAIN, main);
        program.at(0x1f00, &[SPIN]);
        for exception in 1..48 {
            program.word(4 * exception, 0x1f01);
        }
        program.word(4, MAIN | 1);
        program
    }

    /// Instructions at an address.
    pub fn at(&mut self, address: u32, code: &[u16]) -> &mut Self {
        for (i, half) in code.iter().enumerate() {
            let at = address as usize + 2 * i;
            self.flash[at..at + 2].copy_from_slice(&half.to_le_bytes());
        }
        self
    }

    /// A word at an address.
    pub fn word(&mut self, address: u32, word: u32) -> &mut Self {
        self.flash[address as usize..address as usize + 4].copy_from_slice(&word.to_le_bytes());
        self
    }

    /// The handler of an exception.
    pub fn handler(&mut self, exception: u32, code: &[u16]) -> &mut Self {
        let address = 0x400 + exception * 0x40;
        self.word(4 * exception, address | 1).at(address, code)
    }

    /// A chip with this program, at 48 MHz without wait states, that halts at BKPT.
    pub fn chip(&self) -> Chip {
        let mut chip = Chip::new(&Image::from_binary(&self.flash));
        chip.context_mut().clocks.cpu_ticks = 1;
        chip.cpu_mut().set_halts_at_bkpt(true);
        chip
    }
}

/// Runs on by `cycles`.
pub fn run(chip: &mut Chip, cycles: u64) -> Stop {
    let until = chip.now() + cycles;
    chip.run_until(until)
}

/// Runs to BKPT.
pub fn finish(chip: &mut Chip) {
    assert_eq!(run(chip, Cycles::HZ), Stop::Breakpoint, "at pc {:#x}", r(chip, 15));
}

/// A register.
pub fn r(chip: &Chip, register: usize) -> u32 {
    chip.cpu().registers().r[register]
}

/// Sets registers before the next instruction.
pub fn set(chip: &mut Chip, values: &[(usize, u32)]) {
    let mut registers = chip.cpu().registers();
    for (register, value) in values {
        registers.r[*register] = *value;
    }
    chip.cpu_mut().set_registers(&registers);
}
