// One case of the instruction check, as a line of text: shared by the example `oracle` and the test that replays the
// committed vectors. README.md describes the format.

use samc21::cpu::Registers;
use samc21::{Chip, Image, Reset, Width};

/// Where the code of a case lies.
pub const CODE: u32 = 0x1000;
/// The part of SRAM that a case fills, and its bytes. The rest is zero.
const WINDOW: u32 = 0x2000_1000;
const WINDOW_BYTES: u32 = 256;

/// What a case starts from.
pub struct Case {
    seed: u32,
    steps: u32,
    code: Vec<u8>,
    apsr: u32,
    /// R0 to R12, SP, LR, PC.
    r: [u32; 16],
}

impl Case {
    /// Reads `seed steps code apsr r0,...,r15` (hexadecimal but for `steps`).
    pub fn parse(line: &str) -> Option<Case> {
        let mut fields = line.split_whitespace();
        let hex = |text: &str| u32::from_str_radix(text, 16).ok();
        let seed = hex(fields.next()?)?;
        let steps = fields.next()?.parse().ok()?;
        let text = fields.next()?;
        let halves: Option<Vec<u32>> = (0..text.len() / 4).map(|i| hex(&text[4 * i..4 * i + 4])).collect();
        let code = halves?.into_iter().flat_map(|half| (half as u16).to_le_bytes()).collect();
        let apsr = hex(fields.next()?)? << 28;
        let r: Option<Vec<u32>> = fields.next()?.split(',').map(hex).collect();
        Some(Case { seed, steps, code, apsr, r: r?.try_into().ok()? })
    }

    /// Contents of word `index` of the window: one in four points back into the code.
    fn word(&self, index: u32) -> u32 {
        let mut x = self.seed.wrapping_add(index.wrapping_mul(0x9e37_79b9));
        x = (x ^ x >> 16).wrapping_mul(0x85eb_ca6b);
        x = (x ^ x >> 13).wrapping_mul(0xc2b2_ae35);
        x ^= x >> 16;
        match x & 3 {
            0 => CODE + (x >> 8) % (self.code.len() as u32 / 2) * 2 + 1,
            _ => x,
        }
    }

    /// Runs the case: what changed, as `apsr r<n>=... <address>=...`, or `fault`.
    pub fn run(&self, chip: &mut Chip) -> String {
        chip.context_mut().take_violations();
        chip.reset(Reset::PowerOn);
        // An image with a valid vector table, so that a fault does not lock up before it is noticed.
        chip.flash(&Image::from_binary(&[0, 0x20, 0, 0x20, 1, 0x10, 0, 0]));
        chip.nvm_mut().load(CODE, &self.code);
        for index in 0..WINDOW_BYTES / 4 {
            chip.sram_mut().write(WINDOW + 4 * index, Width::Word, self.word(index));
        }
        let before = chip.sram().clone();
        let start = Registers { r: self.r, xpsr: self.apsr, msp: 0, psp: 0, primask: false, control: 0 };
        chip.cpu_mut().set_registers(&start);
        for _ in 0..self.steps {
            chip.step();
        }
        if !chip.violations().is_empty() {
            return format!("fault: {}", chip.violations()[0].kind);
        }
        let end = chip.cpu().registers();
        let mut text = format!("{:x}", end.xpsr >> 28);
        for (register, (old, new)) in self.r.iter().zip(&end.r).enumerate() {
            if old != new {
                text += &format!(" r{register}={new:x}");
            }
        }
        let words = before.bytes().chunks(4).zip(chip.sram().bytes().chunks(4)).enumerate();
        for (index, (_, new)) in words.filter(|(_, (old, new))| old != new) {
            let new = u32::from_le_bytes([new[0], new[1], new[2], new[3]]);
            text += &format!(" {:x}={new:x}", 0x2000_0000 + 4 * index);
        }
        text
    }
}
