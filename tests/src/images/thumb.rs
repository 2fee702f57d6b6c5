//! ARMv6-M machine code, as far as calls and stack go (Armv6-M Architecture Reference Manual, "The Thumb Instruction Set
//! Encoding"). `MOV PC` and `ADD PC` are how a compiler writes a switch: they stay in their function.

/// What an instruction does that matters here.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Effect {
    /// Takes so many bytes of stack.
    Push(u32),
    /// Adds a register to the stack pointer; large frames are made by a negative constant.
    AddSp(u8),
    /// Loads a register with the word at this address.
    Literal(u8, u32),
    /// Calls a function.
    Call(u32),
    /// Jumps; out of the function, it is a call from its end.
    Jump(u32),
    /// Calls or jumps to where a register points.
    Indirect,
    /// None of this.
    Other,
}

/// The instruction at `address`, and its length in bytes.
pub fn decode(address: u32, code: &[u8]) -> (Effect, u32) {
    let half = |at: usize| code.get(at..at + 2).map_or(0, |b| u32::from(u16::from_le_bytes([b[0], b[1]])));
    let (first, second) = (half(0), half(2));
    let relative = |offset: i32| address.wrapping_add(4).wrapping_add_signed(offset);
    if first >> 11 >= 0b11101 {
        // 32 bits; of these only BL matters.
        if first >> 11 == 0b11110 && second >> 14 == 0b11 && second & 0x1000 != 0 {
            let (sign, j1, j2) = (first >> 10 & 1, second >> 13 & 1, second >> 11 & 1);
            let (i1, i2) = (!(j1 ^ sign) & 1, !(j2 ^ sign) & 1);
            let offset = sign << 24 | i1 << 23 | i2 << 22 | (first & 0x3ff) << 12 | (second & 0x7ff) << 1;
            return (Effect::Call(relative(extend(offset, 25))), 4);
        }
        return (Effect::Other, 4);
    }
    let effect = match first {
        _ if first >> 9 == 0b1011010 => Effect::Push(4 * (first & 0x1ff).count_ones()),
        _ if first >> 7 == 0b1_0110_0001 => Effect::Push(4 * (first & 0x7f)),
        // ADD SP, Rm
        _ if first & 0xff87 == 0x4485 => Effect::AddSp((first >> 3 & 15) as u8),
        _ if first >> 11 == 0b01001 => {
            Effect::Literal((first >> 8 & 7) as u8, (address.wrapping_add(4) & !3) + 4 * (first & 0xff))
        }
        // BLX Rm, and BX Rm unless it returns.
        _ if first & 0xff87 == 0x4780 || (first & 0xff87 == 0x4700 && first != 0x4770) => Effect::Indirect,
        _ if first >> 11 == 0b11100 => Effect::Jump(relative(extend((first & 0x7ff) << 1, 12))),
        _ if first >> 12 == 0b1101 && first >> 8 & 15 < 14 => Effect::Jump(relative(extend((first & 0xff) << 1, 9))),
        _ => Effect::Other,
    };
    (effect, 2)
}

fn extend(value: u32, bits: u32) -> i32 {
    ((value << (32 - bits)) as i32) >> (32 - bits)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(address: u32, halves: &[u16]) -> (Effect, u32) {
        let code: Vec<u8> = halves.iter().flat_map(|half| half.to_le_bytes()).collect();
        decode(address, &code)
    }

    #[test]
    fn known_encodings_decode_as_an_assembler_writes_them() {
        // push {r4-r7, lr}; sub sp, #148; add sp, r4; ldr r4, [pc, #40]
        assert_eq!(at(0, &[0xb5f0]), (Effect::Push(20), 2));
        assert_eq!(at(0, &[0xb0a5]), (Effect::Push(148), 2));
        assert_eq!(at(0, &[0x44a5]), (Effect::AddSp(4), 2));
        assert_eq!(at(0x102, &[0x4c0a]), (Effect::Literal(4, 0x104 + 40), 2));
        // bl forward and back, b, beq, blx r3, bx r1, bx lr
        assert_eq!(at(0x1000, &[0xf000, 0xf802]), (Effect::Call(0x1008), 4));
        assert_eq!(at(0x1000, &[0xf7ff, 0xfffe]), (Effect::Call(0x1000), 4));
        assert_eq!(at(0x1000, &[0xe7fe]), (Effect::Jump(0x1000), 2));
        assert_eq!(at(0x1000, &[0xd0fe]), (Effect::Jump(0x1000), 2));
        assert_eq!(at(0, &[0x4798]), (Effect::Indirect, 2));
        assert_eq!(at(0, &[0x4708]), (Effect::Indirect, 2));
        assert_eq!(at(0, &[0x4770]), (Effect::Other, 2));
        // add sp, #148 gives stack back; svc; dmb; udf
        assert_eq!(at(0, &[0xb025]), (Effect::Other, 2));
        assert_eq!(at(0, &[0xdf00]), (Effect::Other, 2));
        assert_eq!(at(0, &[0xf3bf, 0x8f5f]), (Effect::Other, 4));
        assert_eq!(at(0, &[0xdefe]), (Effect::Other, 2));
    }
}
