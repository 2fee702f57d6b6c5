//! The end of the road: a panic, a HardFault or a stray interrupt brakes, leaves a record in RAM and resets.

use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::ptr::addr_of_mut;

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use sarah_protocol::telemetry::ResetCause;

use super::boot::{BootReport, Fault, Record, reset_cause, stir};
use super::clocks::ClockSource;
use super::outputs::brake_now;
use super::regs::system::{RSTC, Rstc};

/// Not initialised by the start-up code, so that it survives a reset.
#[unsafe(link_section = ".uninit.fault")]
static mut RECORD: MaybeUninit<Record> = MaybeUninit::uninit();
/// The last nonce, likewise.
#[unsafe(link_section = ".uninit.nonce")]
static mut NONCE: MaybeUninit<u32> = MaybeUninit::uninit();

fn die(fault: Fault) -> ! {
    cortex_m::interrupt::disable();
    brake_now();
    // SAFETY: interrupts are off and this never returns; any bit pattern is a record.
    unsafe { addr_of_mut!(RECORD).cast::<Record>().write_volatile(fault.record()) };
    SCB::sys_reset()
}

/// Reads and clears what the last life left behind. Call once, at start.
pub fn report(clock: ClockSource) -> BootReport {
    // SAFETY: called once, before any interrupt is on; any bit pattern is a record, or a number.
    let (fault, last) = unsafe {
        let record = addr_of_mut!(RECORD).cast::<Record>();
        let fault = Fault::recall(record.read_volatile());
        record.write_volatile([0; 4]);
        (fault, addr_of_mut!(NONCE).cast::<u32>().read_volatile())
    };
    // SAFETY: the reset controller lies there and is only read.
    let flags = unsafe { Rstc::new_mmio_at(RSTC) }.read_rcause();
    let cause = reset_cause(flags);
    // The crystal takes a different time to start each time; the counter has run meanwhile.
    let nonce = stir(last, cortex_m::peripheral::SYST::get_current());
    // SAFETY: as above.
    unsafe { addr_of_mut!(NONCE).cast::<u32>().write_volatile(nonce) };
    BootReport { cause, fault: fault.filter(|_| cause != ResetCause::PowerOn), clock, nonce }
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    die(Fault::Panic { line: info.location().map_or(0, |location| location.line()) })
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    die(Fault::HardFault { pc: frame.pc() })
}

#[exception]
unsafe fn DefaultHandler(line: i16) {
    die(Fault::Stray { line: line.into() })
}
