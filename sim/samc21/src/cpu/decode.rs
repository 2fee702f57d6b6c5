//! Instructions, decoded once per place in memory (ARMv6-M ARM, A5 "The Thumb instruction set encoding").

/// Which way a shift by a register goes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Shift {
    Left,
    Right,
    Arithmetic,
    Rotate,
}

/// A decoded instruction. Registers are numbers 0 to 15; immediates and branch targets are final values.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[rustfmt::skip]
// Aligned so that one is read in one go.
#[repr(align(8))]
pub(crate) enum Op {
    Moves { d: u8, m: u8 },
    LslImm { d: u8, m: u8, shift: u8 },
    /// By 1 to 32.
    LsrImm { d: u8, m: u8, shift: u8 },
    /// By 1 to 32.
    AsrImm { d: u8, m: u8, shift: u8 },
    AddReg { d: u8, n: u8, m: u8 },
    SubReg { d: u8, n: u8, m: u8 },
    AddImm { d: u8, n: u8, imm: u32 },
    SubImm { d: u8, n: u8, imm: u32 },
    MovImm { d: u8, imm: u32 },
    CmpImm { n: u8, imm: u32 },
    And { d: u8, m: u8 },
    Eor { d: u8, m: u8 },
    ShiftReg { shift: Shift, d: u8, m: u8 },
    Adc { d: u8, m: u8 },
    Sbc { d: u8, m: u8 },
    Tst { n: u8, m: u8 },
    Rsb { d: u8, n: u8 },
    CmpReg { n: u8, m: u8 },
    Cmn { n: u8, m: u8 },
    Orr { d: u8, m: u8 },
    Mul { d: u8, m: u8 },
    Bic { d: u8, m: u8 },
    Mvn { d: u8, m: u8 },
    /// Neither register is SP or PC.
    AddHigh { d: u8, m: u8 },
    /// Neither register is SP or PC.
    MovHigh { d: u8, m: u8 },
    /// SP or PC take part.
    AddSpecial { d: u8, m: u8 },
    /// SP or PC take part.
    MovSpecial { d: u8, m: u8 },
    Bx { m: u8 },
    Blx { m: u8 },
    LdrLiteral { t: u8, address: u32 },
    StrReg { t: u8, n: u8, m: u8 },
    StrhReg { t: u8, n: u8, m: u8 },
    StrbReg { t: u8, n: u8, m: u8 },
    LdrsbReg { t: u8, n: u8, m: u8 },
    LdrReg { t: u8, n: u8, m: u8 },
    LdrhReg { t: u8, n: u8, m: u8 },
    LdrbReg { t: u8, n: u8, m: u8 },
    LdrshReg { t: u8, n: u8, m: u8 },
    StrImm { t: u8, n: u8, offset: u32 },
    LdrImm { t: u8, n: u8, offset: u32 },
    StrbImm { t: u8, n: u8, offset: u32 },
    LdrbImm { t: u8, n: u8, offset: u32 },
    StrhImm { t: u8, n: u8, offset: u32 },
    LdrhImm { t: u8, n: u8, offset: u32 },
    /// ADR: the address itself.
    Adr { d: u8, address: u32 },
    /// ADD Rd, SP, #offset; for SP itself also SUB, as a negative offset.
    AddSp { d: u8, offset: u32 },
    Sxth { d: u8, m: u8 },
    Sxtb { d: u8, m: u8 },
    Uxth { d: u8, m: u8 },
    Uxtb { d: u8, m: u8 },
    Rev { d: u8, m: u8 },
    Rev16 { d: u8, m: u8 },
    Revsh { d: u8, m: u8 },
    /// Bit 14 is LR.
    Push { list: u16 },
    /// Low registers only.
    Pop { list: u16 },
    /// Low registers, then PC.
    PopPc { list: u16 },
    Stm { n: u8, list: u16 },
    Ldm { n: u8, list: u16 },
    Cps { disable: bool },
    Bkpt,
    Svc,
    Nop,
    Wfe,
    Wfi,
    Sev,
    BranchEq { target: u32 },
    BranchNe { target: u32 },
    BranchCs { target: u32 },
    BranchCc { target: u32 },
    BranchMi { target: u32 },
    BranchPl { target: u32 },
    BranchVs { target: u32 },
    BranchVc { target: u32 },
    BranchHi { target: u32 },
    BranchLs { target: u32 },
    BranchGe { target: u32 },
    BranchLt { target: u32 },
    BranchGt { target: u32 },
    BranchLe { target: u32 },
    Branch { target: u32 },
    /// `target` of BL; the return address follows from the instruction's own.
    BranchLink { target: u32 },
    Msr { n: u8, special: u8 },
    Mrs { d: u8, special: u8 },
    /// DMB, DSB, ISB.
    Barrier,
    /// Not decoded yet, or watched by a debugger; what it is stands in memory.
    Unknown,
    Undefined,
}

/// Whether `first` begins a 32-bit instruction.
pub(crate) const fn is_wide(first: u16) -> bool {
    first >> 11 >= 0b11101
}

/// Decodes the instruction at `pc` whose halfwords are `first` and, if it is wide, `second`.
pub(crate) fn decode(pc: u32, first: u16, second: u16) -> Op {
    let op = u32::from(first);
    let reg = |at: u32| (op >> at & 7) as u8;
    let (d, m, high) = (reg(0), reg(3), reg(8));
    let imm5 = op >> 6 & 31;
    let imm8 = op & 0xff;
    let list = imm8 as u16;
    let here = pc.wrapping_add(4);
    let literal = (here & !3).wrapping_add(imm8 * 4);
    match op >> 11 {
        0 if imm5 == 0 => Op::Moves { d, m },
        0 => Op::LslImm { d, m, shift: imm5 as u8 },
        1 => Op::LsrImm { d, m, shift: if imm5 == 0 { 32 } else { imm5 as u8 } },
        2 => Op::AsrImm { d, m, shift: if imm5 == 0 { 32 } else { imm5 as u8 } },
        3 => match op >> 9 & 3 {
            0 => Op::AddReg { d, n: m, m: reg(6) },
            1 => Op::SubReg { d, n: m, m: reg(6) },
            2 => Op::AddImm { d, n: m, imm: imm5 & 7 },
            _ => Op::SubImm { d, n: m, imm: imm5 & 7 },
        },
        4 => Op::MovImm { d: high, imm: imm8 },
        5 => Op::CmpImm { n: high, imm: imm8 },
        6 => Op::AddImm { d: high, n: high, imm: imm8 },
        7 => Op::SubImm { d: high, n: high, imm: imm8 },
        8 if op & 0x400 == 0 => data_processing(op >> 6 & 15, d, m),
        8 => special_data(op),
        9 => Op::LdrLiteral { t: high, address: literal },
        10 | 11 => register_offset(op >> 9 & 7, d, m, reg(6)),
        12 => Op::StrImm { t: d, n: m, offset: imm5 * 4 },
        13 => Op::LdrImm { t: d, n: m, offset: imm5 * 4 },
        14 => Op::StrbImm { t: d, n: m, offset: imm5 },
        15 => Op::LdrbImm { t: d, n: m, offset: imm5 },
        16 => Op::StrhImm { t: d, n: m, offset: imm5 * 2 },
        17 => Op::LdrhImm { t: d, n: m, offset: imm5 * 2 },
        18 => Op::StrImm { t: high, n: 13, offset: imm8 * 4 },
        19 => Op::LdrImm { t: high, n: 13, offset: imm8 * 4 },
        20 => Op::Adr { d: high, address: literal },
        21 => Op::AddSp { d: high, offset: imm8 * 4 },
        22 | 23 => miscellaneous(op),
        24 => Op::Stm { n: high, list },
        25 => Op::Ldm { n: high, list },
        26 | 27 => match (op >> 8 & 15) as u8 {
            14 => Op::Undefined,
            15 => Op::Svc,
            condition => branch_if(condition, here.wrapping_add_signed(i32::from(imm8 as u8 as i8) * 2)),
        },
        28 => Op::Branch { target: here.wrapping_add_signed((op << 21) as i32 >> 20) },
        30 => wide(here, op, u32::from(second)),
        _ => Op::Undefined,
    }
}

/// A branch under a condition (ARMv6-M ARM, A6.3): each its own instruction here, so that none is looked up.
fn branch_if(condition: u8, target: u32) -> Op {
    match condition {
        0 => Op::BranchEq { target },
        1 => Op::BranchNe { target },
        2 => Op::BranchCs { target },
        3 => Op::BranchCc { target },
        4 => Op::BranchMi { target },
        5 => Op::BranchPl { target },
        6 => Op::BranchVs { target },
        7 => Op::BranchVc { target },
        8 => Op::BranchHi { target },
        9 => Op::BranchLs { target },
        10 => Op::BranchGe { target },
        11 => Op::BranchLt { target },
        12 => Op::BranchGt { target },
        _ => Op::BranchLe { target },
    }
}

fn data_processing(code: u32, d: u8, m: u8) -> Op {
    match code {
        0 => Op::And { d, m },
        1 => Op::Eor { d, m },
        2 => Op::ShiftReg { shift: Shift::Left, d, m },
        3 => Op::ShiftReg { shift: Shift::Right, d, m },
        4 => Op::ShiftReg { shift: Shift::Arithmetic, d, m },
        5 => Op::Adc { d, m },
        6 => Op::Sbc { d, m },
        7 => Op::ShiftReg { shift: Shift::Rotate, d, m },
        8 => Op::Tst { n: d, m },
        9 => Op::Rsb { d, n: m },
        10 => Op::CmpReg { n: d, m },
        11 => Op::Cmn { n: d, m },
        12 => Op::Orr { d, m },
        13 => Op::Mul { d, m },
        14 => Op::Bic { d, m },
        _ => Op::Mvn { d, m },
    }
}

fn special_data(op: u32) -> Op {
    let m = (op >> 3 & 15) as u8;
    let d = (op & 7 | op >> 4 & 8) as u8;
    let special = d == 13 || d == 15 || m == 13 || m == 15;
    match op >> 8 & 3 {
        0 if special => Op::AddSpecial { d, m },
        0 => Op::AddHigh { d, m },
        // Unpredictable with PC; SP compares like any register.
        1 if d == 15 || m == 15 => Op::Undefined,
        1 => Op::CmpReg { n: d, m },
        2 if special => Op::MovSpecial { d, m },
        2 => Op::MovHigh { d, m },
        _ if op & 7 != 0 || m == 15 && op & 0x80 != 0 => Op::Undefined,
        _ if op & 0x80 == 0 => Op::Bx { m },
        _ => Op::Blx { m },
    }
}

fn register_offset(code: u32, t: u8, n: u8, m: u8) -> Op {
    match code {
        0 => Op::StrReg { t, n, m },
        1 => Op::StrhReg { t, n, m },
        2 => Op::StrbReg { t, n, m },
        3 => Op::LdrsbReg { t, n, m },
        4 => Op::LdrReg { t, n, m },
        5 => Op::LdrhReg { t, n, m },
        6 => Op::LdrbReg { t, n, m },
        _ => Op::LdrshReg { t, n, m },
    }
}

fn miscellaneous(op: u32) -> Op {
    let (d, m) = ((op & 7) as u8, (op >> 3 & 7) as u8);
    let list = (op & 0xff) as u16;
    let adjust = (op & 0x7f) * 4;
    match op >> 8 & 15 {
        0 if op & 0x80 == 0 => Op::AddSp { d: 13, offset: adjust },
        0 => Op::AddSp { d: 13, offset: adjust.wrapping_neg() },
        2 => match op >> 6 & 3 {
            0 => Op::Sxth { d, m },
            1 => Op::Sxtb { d, m },
            2 => Op::Uxth { d, m },
            _ => Op::Uxtb { d, m },
        },
        4 => Op::Push { list },
        5 => Op::Push { list: list | 1 << 14 },
        6 if op & 0xffef == 0xb662 => Op::Cps { disable: op & 0x10 != 0 },
        10 => match op >> 6 & 3 {
            0 => Op::Rev { d, m },
            1 => Op::Rev16 { d, m },
            3 => Op::Revsh { d, m },
            _ => Op::Undefined,
        },
        12 => Op::Pop { list },
        13 => Op::PopPc { list },
        14 => Op::Bkpt,
        15 if op & 0xf != 0 => Op::Undefined,
        15 => match op >> 4 & 15 {
            2 => Op::Wfe,
            3 => Op::Wfi,
            4 => Op::Sev,
            // NOP, YIELD, and unallocated hints, which execute as NOP.
            _ => Op::Nop,
        },
        _ => Op::Undefined,
    }
}

fn wide(here: u32, first: u32, second: u32) -> Op {
    if second & 0xd000 == 0xd000 {
        let sign = first >> 10 & 1;
        let i1 = !(second >> 13 ^ sign) & 1;
        let i2 = !(second >> 11 ^ sign) & 1;
        let offset = sign << 24 | i1 << 23 | i2 << 22 | (first & 0x3ff) << 12 | (second & 0x7ff) << 1;
        return Op::BranchLink { target: here.wrapping_add_signed((offset << 7) as i32 >> 7) };
    }
    if second & 0xd000 != 0x8000 {
        return Op::Undefined;
    }
    let special = (second & 0xff) as u8;
    match first {
        0xf380..=0xf39f => Op::Msr { n: (first & 15) as u8, special },
        0xf3e0..=0xf3ff => Op::Mrs { d: (second >> 8 & 15) as u8, special },
        0xf3b0..=0xf3bf if matches!(second >> 4 & 15, 4..=6) => Op::Barrier,
        _ => Op::Undefined,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decoded_instruction_fits_in_eight_bytes() {
        assert_eq!(size_of::<Op>(), 8);
    }

    #[test]
    fn branch_targets_are_relative_to_the_instruction_after_next() {
        assert_eq!(decode(0x100, 0xe7fe, 0), Op::Branch { target: 0x100 });
        assert_eq!(decode(0x100, 0xd0ff, 0), Op::BranchEq { target: 0x102 });
        assert_eq!(decode(0x100, 0xf7ff, 0xfffe), Op::BranchLink { target: 0x100 });
        assert_eq!(decode(0x100, 0xf000, 0xf800), Op::BranchLink { target: 0x104 });
    }

    #[test]
    fn literals_are_relative_to_the_aligned_pc() {
        assert_eq!(decode(0x102, 0x4801, 0), Op::LdrLiteral { t: 0, address: 0x108 });
        assert_eq!(decode(0x100, 0xa002, 0), Op::Adr { d: 0, address: 0x10c });
    }

    #[test]
    fn erased_flash_is_undefined() {
        assert_eq!(decode(0, 0xffff, 0xffff), Op::Undefined);
    }

    #[test]
    fn system_instructions_of_32_bits_are_told_apart() {
        assert_eq!(decode(0, 0xf3ef, 0x8310), Op::Mrs { d: 3, special: 16 });
        assert_eq!(decode(0, 0xf383, 0x8810), Op::Msr { n: 3, special: 16 });
        assert_eq!(decode(0, 0xf3bf, 0x8f4f), Op::Barrier);
        assert_eq!(decode(0, 0xf7f0, 0xa000), Op::Undefined);
    }
}
