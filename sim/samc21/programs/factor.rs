//! Integer workload for speed measurements, shaped like the LPGs' Factor: table look-up with interpolation, 64-bit
//! products, a division (by DIVAS on its I/O bus, or with `--cfg soft_division` by the CPU), a Newton step.
//!
//! Repeats for ever; `ROUNDS` counts, then `SUM` has the results so far.
#![no_std]
#![no_main]

#[used]
#[unsafe(link_section = ".vectors")]
static VECTORS: [Vector; 2] = [Vector { stack: 0x2000_8000 }, Vector { handler: start }];

#[repr(C)]
union Vector {
    stack: usize,
    handler: extern "C" fn() -> !,
}

// SAFETY: the table is only ever read, by the processor.
unsafe impl Sync for Vector {}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {}
}

const ROUNDS: *mut u32 = 0x2000_0000 as *mut u32;
const SUM: *mut u32 = 0x2000_0004 as *mut u32;

/// exp2(-i/256) in Q30.
static EXP2_NEG: [u32; 257] = {
    let mut table = [0; 257];
    let mut value = (1u64 << 30) as f64;
    let mut i = 0;
    while i < 257 {
        table[i] = (value + 0.5) as u32;
        value *= 0.997_296_056_085_470_1;
        i += 1;
    }
    table
};

#[cfg(not(soft_division))]
fn divide(numerator: u32, denominator: u32) -> u32 {
    const DIVAS: usize = 0x6000_0200;
    // SAFETY: DIVAS registers, which nothing else in this program uses.
    unsafe {
        ((DIVAS + 0x08) as *mut u32).write_volatile(numerator);
        ((DIVAS + 0x0c) as *mut u32).write_volatile(denominator);
        ((DIVAS + 0x10) as *const u32).read_volatile()
    }
}

#[cfg(soft_division)]
fn divide(numerator: u32, denominator: u32) -> u32 {
    numerator / denominator
}

fn exp2_neg(x: u32) -> u32 {
    let whole = x >> 20;
    if whole > 30 {
        return 0;
    }
    let (index, rest) = ((x >> 12 & 0xff) as usize, x & 0xfff);
    let (high, low) = (EXP2_NEG[index], EXP2_NEG[index + 1]);
    (high - (((high - low) as u64 * rest as u64) >> 12) as u32) >> whole
}

fn logistic(x: i32) -> u32 {
    let denominator = (1 << 30) + exp2_neg(x.unsigned_abs());
    let rough = divide(1 << 31, denominator >> 16);
    let residual = (1i64 << 47) - denominator as i64 * rough as i64;
    let above = ((rough << 13) as i32 + ((rough as i64 * (residual >> 16)) >> 18) as i32) as u32;
    if x < 0 { above } else { (1 << 30) - above }
}

#[unsafe(no_mangle)]
#[inline(never)]
extern "C" fn factor(acceleration: i32, rotation: i32) -> u32 {
    let fall = (acceleration - (5 << 16)) << 4;
    let turn = 8_309_767 - ((rotation as i64 * 265_912_546) >> 20) as i32;
    logistic(fall).wrapping_add(logistic(turn))
}

#[unsafe(no_mangle)]
extern "C" fn start() -> ! {
    let (mut rounds, mut sum) = (0u32, 0u32);
    loop {
        let acceleration = (rounds.wrapping_mul(40_503) >> 6 & 0x1f_ffff) as i32;
        let rotation = (rounds.wrapping_mul(12_345) >> 8 & 0x3_ffff) as i32;
        sum = sum.wrapping_add(factor(acceleration, rotation));
        rounds = rounds.wrapping_add(1);
        // SAFETY: two words of SRAM that nothing else uses.
        unsafe {
            ROUNDS.write_volatile(rounds);
            SUM.write_volatile(sum);
        }
    }
}
