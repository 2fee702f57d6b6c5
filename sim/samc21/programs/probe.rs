//! Interrupt probe: each check writes its result where the test finds it.
//!
//! The test plays the outside: it sets the interrupt lines to `LINES` (at once, and says so in `SEEN`) or to `LATER`
//! (after a while).
#![no_std]
#![no_main]

use core::arch::asm;

#[repr(C)]
union Vector {
    word: usize,
    reset: extern "C" fn() -> !,
    handler: extern "C" fn(),
}

// SAFETY: the table is only ever read, by the processor.
unsafe impl Sync for Vector {}

const IGNORED: Vector = Vector { handler: stray };

#[used]
#[unsafe(link_section = ".vectors")]
static VECTORS: [Vector; 48] = {
    let mut table = [IGNORED; 48];
    table[0] = Vector { word: 0x2000_6000 };
    table[1] = Vector { reset: start };
    table[11] = Vector { handler: svcall };
    table[14] = Vector { handler: pendsv };
    table[15] = Vector { handler: systick };
    table[16 + 3] = Vector { handler: eic };
    table[16 + 7] = Vector { handler: dmac };
    table[16 + 15] = Vector { handler: can0 };
    table
};

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {}
}

const LINES: *mut u32 = 0x2000_7000 as *mut u32;
const SEEN: *mut u32 = 0x2000_7004 as *mut u32;
const LATER: *mut u32 = 0x2000_7008 as *mut u32;
const RESULTS: *mut u32 = 0x2000_7010 as *mut u32;
const ORDER: *mut u32 = 0x2000_7100 as *mut u32;
const TICKS: *mut u32 = 0x2000_7104 as *mut u32;

const ISER: *mut u32 = 0xe000_e100 as *mut u32;
const ISPR: *mut u32 = 0xe000_e200 as *mut u32;
const IPR: *mut u32 = 0xe000_e400 as *mut u32;
const ICSR: *mut u32 = 0xe000_ed04 as *mut u32;
const SYST: *mut u32 = 0xe000_e010 as *mut u32;

const EIC: u32 = 3;
const DMAC: u32 = 7;
const CAN0: u32 = 15;

fn get(at: *mut u32) -> u32 {
    // SAFETY: every address here is a fixed word of SRAM that nothing else uses, or a system register.
    unsafe { at.read_volatile() }
}

fn put(at: *mut u32, value: u32) {
    // SAFETY: as in `get`.
    unsafe { at.write_volatile(value) }
}

fn out(check: u32, value: u32) {
    put(RESULTS.wrapping_add(check as usize), value);
}

fn note(digit: u32) {
    put(ORDER, get(ORDER) << 4 | digit);
}

fn raise(lines: u32) {
    put(LINES, lines);
    while get(SEEN) != lines {}
}

fn pend(irq: u32) {
    put(ISPR, 1 << irq);
}

fn barrier() {
    // SAFETY: barriers and NOP change no state.
    unsafe { asm!("dsb", "isb", "nop") }
}

macro_rules! instruction {
    ($name:ident, $text:literal) => {
        fn $name() {
            // SAFETY: the instruction touches neither registers nor memory.
            unsafe { asm!($text) }
        }
    };
}
instruction!(cpsid, "cpsid i");
instruction!(cpsie, "cpsie i");
instruction!(wfi, "wfi");
instruction!(wfe, "wfe");
instruction!(sev, "sev");
instruction!(svc, "svc 0");

extern "C" fn stray() {
    note(0xf);
}
extern "C" fn svcall() {
    note(6);
}
extern "C" fn pendsv() {
    note(7);
}
extern "C" fn systick() {
    put(TICKS, get(TICKS) + 1);
}
extern "C" fn eic() {
    raise(0);
    note(1);
}
extern "C" fn can0() {
    note(2);
    pend(DMAC);
    barrier();
    note(3);
}
extern "C" fn dmac() {
    note(4);
}

fn order_of(action: impl FnOnce()) -> u32 {
    put(ORDER, 0);
    action();
    barrier();
    get(ORDER)
}

extern "C" fn start() -> ! {
    // A line raised while its interrupt is disabled is not taken, but stays pending and is taken when enabled.
    out(0, order_of(|| raise(1 << EIC)));
    out(1, order_of(|| put(ISER, 1 << EIC)));
    // PRIMASK holds it back, and lets it go.
    cpsid();
    out(2, order_of(|| raise(1 << EIC)));
    out(3, order_of(cpsie));
    // WFI under PRIMASK wakes without entry.
    cpsid();
    out(4, order_of(|| {
        put(LATER, 1 << EIC);
        wfi();
    }));
    out(5, order_of(cpsie));
    // SEV lets WFE pass.
    sev();
    wfe();
    out(6, 1);
    // A more urgent interrupt nests; an equal one waits.
    put(ISER, 1 << CAN0 | 1 << DMAC);
    put(IPR.wrapping_add(3), 0x80 << 24);
    put(IPR.wrapping_add(1), 0x40 << 24);
    out(7, order_of(|| pend(CAN0)));
    put(IPR.wrapping_add(1), 0x80 << 24);
    out(8, order_of(|| pend(CAN0)));
    // PendSV and SVCall.
    out(9, order_of(|| put(ICSR, 1 << 28)));
    out(10, order_of(svc));
    // SysTick wakes WFI five times.
    put(SYST.wrapping_add(1), 999);
    put(SYST.wrapping_add(2), 0);
    put(SYST, 7);
    while get(TICKS) < 5 {
        wfi();
    }
    put(SYST, 5);
    out(11, get(TICKS));
    out(12, 0x600d);
    loop {
        wfi();
    }
}
