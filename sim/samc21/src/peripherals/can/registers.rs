//! Register map of M_CAN: what may be written, and when (M_CAN User's Manual, 2.3 "Registers").

use crate::time::Cycles;
use crate::wires::CanTiming;

pub const CREL: u32 = 0x00;
pub const ENDN: u32 = 0x04;
pub const MRCFG: u32 = 0x08;
pub const DBTP: u32 = 0x0c;
pub const TEST: u32 = 0x10;
pub const RWD: u32 = 0x14;
pub const CCCR: u32 = 0x18;
pub const NBTP: u32 = 0x1c;
pub const TSCC: u32 = 0x20;
pub const TSCV: u32 = 0x24;
pub const TOCC: u32 = 0x28;
pub const TOCV: u32 = 0x2c;
pub const ECR: u32 = 0x40;
pub const PSR: u32 = 0x44;
pub const TDCR: u32 = 0x48;
pub const IR: u32 = 0x50;
pub const IE: u32 = 0x54;
pub const ILS: u32 = 0x58;
pub const ILE: u32 = 0x5c;
pub const GFC: u32 = 0x80;
pub const SIDFC: u32 = 0x84;
pub const XIDFC: u32 = 0x88;
pub const XIDAM: u32 = 0x90;
pub const HPMS: u32 = 0x94;
pub const NDAT1: u32 = 0x98;
pub const NDAT2: u32 = 0x9c;
pub const RXF0C: u32 = 0xa0;
pub const RXF0S: u32 = 0xa4;
pub const RXF0A: u32 = 0xa8;
pub const RXBC: u32 = 0xac;
pub const RXF1C: u32 = 0xb0;
pub const RXF1S: u32 = 0xb4;
pub const RXF1A: u32 = 0xb8;
pub const RXESC: u32 = 0xbc;
pub const TXBC: u32 = 0xc0;
pub const TXFQS: u32 = 0xc4;
pub const TXESC: u32 = 0xc8;
pub const TXBRP: u32 = 0xcc;
pub const TXBAR: u32 = 0xd0;
pub const TXBCR: u32 = 0xd4;
pub const TXBTO: u32 = 0xd8;
pub const TXBCF: u32 = 0xdc;
pub const TXBTIE: u32 = 0xe0;
pub const TXBCIE: u32 = 0xe4;
pub const TXEFC: u32 = 0xf0;
pub const TXEFS: u32 = 0xf4;
pub const TXEFA: u32 = 0xf8;

pub const CCCR_INIT: u32 = 1 << 0;
pub const CCCR_CCE: u32 = 1 << 1;
pub const CCCR_ASM: u32 = 1 << 2;
pub const CCCR_CSA: u32 = 1 << 3;
pub const CCCR_CSR: u32 = 1 << 4;
pub const CCCR_MON: u32 = 1 << 5;
pub const CCCR_DAR: u32 = 1 << 6;
pub const CCCR_TEST: u32 = 1 << 7;
pub const CCCR_FDOE: u32 = 1 << 8;
pub const CCCR_BRSE: u32 = 1 << 9;
/// All bits but the read-only CSA.
pub const CCCR_WRITABLE: u32 = 0xf3f7;
/// Bits that software may set only with INIT and CCE set, but clear at any time.
pub const CCCR_SET_PROTECTED: u32 = CCCR_ASM | CCCR_MON | CCCR_TEST;
/// Bits that software may change only with INIT and CCE set.
pub const CCCR_PROTECTED: u32 = 0xf340;

pub const DBTP_TDC: u32 = 1 << 23;
pub const TEST_LBCK: u32 = 1 << 4;

/// Interrupt flags (IR).
pub mod flag {
    /// FIFO 0: new message, watermark, full, lost. FIFO 1: the same, shifted by 4.
    pub const RF0N: u32 = 1 << 0;
    pub const RF0W: u32 = 1 << 1;
    pub const RF0F: u32 = 1 << 2;
    pub const RF0L: u32 = 1 << 3;
    pub const HPM: u32 = 1 << 8;
    pub const TC: u32 = 1 << 9;
    pub const TCF: u32 = 1 << 10;
    pub const TFE: u32 = 1 << 11;
    pub const TEFN: u32 = 1 << 12;
    pub const TEFW: u32 = 1 << 13;
    pub const TEFF: u32 = 1 << 14;
    pub const TEFL: u32 = 1 << 15;
    pub const TSW: u32 = 1 << 16;
    pub const DRX: u32 = 1 << 19;
    pub const ELO: u32 = 1 << 22;
    pub const EP: u32 = 1 << 23;
    pub const EW: u32 = 1 << 24;
    pub const BO: u32 = 1 << 25;
    pub const PEA: u32 = 1 << 27;
    pub const PED: u32 = 1 << 28;
    /// All that exist.
    pub const ALL: u32 = 0x3fff_ffff;
}

/// When a register may be written.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Write {
    /// Always.
    Free,
    /// While INIT and CCE are set.
    Protected,
    /// Never.
    Never,
    /// By rules of its own.
    Special,
}

/// Writable bits of the register at an offset, and when they may be written. `None`: no register there.
pub const fn rule(offset: u32) -> Option<(u32, Write)> {
    Some(match offset {
        MRCFG | ILE => (0x3, Write::Free),
        IE | ILS => (flag::ALL, Write::Free),
        TXBTIE | TXBCIE => (u32::MAX, Write::Free),
        DBTP => (0x009f_1fff, Write::Protected),
        RWD => (0xff, Write::Protected),
        NBTP => (0xffff_ff7f, Write::Protected),
        TSCC => (0x000f_0003, Write::Protected),
        TOCC => (0xffff_0007, Write::Protected),
        TDCR => (0x7f7f, Write::Protected),
        GFC => (0x3f, Write::Protected),
        SIDFC => (0x00ff_ffff, Write::Protected),
        XIDFC => (0x007f_ffff, Write::Protected),
        XIDAM => (0x1fff_ffff, Write::Protected),
        RXF0C | RXF1C => (0xff7f_ffff, Write::Protected),
        RXBC => (0xffff, Write::Protected),
        RXESC => (0x777, Write::Protected),
        TXBC => (0x7f3f_ffff, Write::Protected),
        TXESC => (0x7, Write::Protected),
        TXEFC => (0x3f3f_ffff, Write::Protected),
        CCCR => (CCCR_WRITABLE | CCCR_CSA, Write::Special),
        TEST => (0xf0, Write::Special),
        TSCV | TOCV => (0xffff, Write::Special),
        IR => (flag::ALL, Write::Special),
        NDAT1 | NDAT2 | TXBAR | TXBCR => (u32::MAX, Write::Special),
        RXF0A | RXF1A => (0x3f, Write::Special),
        TXEFA => (0x1f, Write::Special),
        CREL | ENDN | ECR | PSR | HPMS | RXF0S | RXF1S | TXFQS | TXBRP | TXBTO | TXBCF | TXEFS => (0, Write::Never),
        _ => return None,
    })
}

/// The registers that just keep what is written.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Registers([u32; 64]);

impl Default for Registers {
    fn default() -> Self {
        let mut registers = Registers([0; 64]);
        for (offset, value) in [
            (CREL, 0x3210_0000),
            (ENDN, 0x8765_4321),
            (MRCFG, 2),
            (DBTP, 0xa33),
            (CCCR, CCCR_INIT),
            (NBTP, 0x0600_0a03),
            (TOCC, 0xffff_0000),
            (TOCV, 0xffff),
            (XIDAM, 0x1fff_ffff),
        ] {
            registers.set(offset, value);
        }
        registers
    }
}

impl Registers {
    /// Value of a register.
    pub fn get(&self, offset: u32) -> u32 {
        self.0[(offset / 4) as usize % 64]
    }

    /// Sets a register.
    pub fn set(&mut self, offset: u32, value: u32) {
        self.0[(offset / 4) as usize % 64] = value;
    }

    /// A field of a register.
    pub fn field(&self, offset: u32, bit: u32, width: u32) -> u32 {
        self.get(offset) >> bit & ((1 << width) - 1)
    }

    /// Whether all of `bits` of CCCR are set.
    pub fn cccr(&self, bits: u32) -> bool {
        self.get(CCCR) & bits == bits
    }

    /// Bit timing with a CAN clock of `hertz`.
    pub fn timing(&self, hertz: u32) -> CanTiming {
        let ticks = |quanta: u32, prescaler: u32| {
            let clocks = u64::from(quanta) * u64::from(prescaler + 1);
            ((clocks * Cycles::HZ + u64::from(hertz) / 2) / u64::from(hertz)) as u32
        };
        let [before, after, prescaler] = [(8, 8), (0, 7), (16, 9)].map(|(bit, width)| self.field(NBTP, bit, width));
        let [fast_before, fast_after, fast_prescaler] =
            [(8, 5), (4, 4), (16, 5)].map(|(bit, width)| self.field(DBTP, bit, width));
        CanTiming {
            nominal: ticks(before + after + 3, prescaler),
            nominal_sample: ticks(before + 2, prescaler),
            data: ticks(fast_before + fast_after + 3, fast_prescaler),
            data_sample: ticks(fast_before + 2, fast_prescaler),
        }
    }
}
