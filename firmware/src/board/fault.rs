//! The end of the road: a panic, a HardFault or a stray interrupt makes the board safe, leaves a record in RAM and
//! resets. What is safe the board knows: a node brakes, a coordinator that has no brakes falls silent.

use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::ptr::addr_of_mut;

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use sarah_protocol::telemetry::ResetCause;

use super::boot::{BootReport, ClockSource, Fault, Record, stir};
#[cfg(feature = "samc21")]
use super::samc21::outputs::brake_now as make_safe;
#[cfg(feature = "same54")]
use super::same54::fall_silent as make_safe;

/// Not initialised by the start-up code, so that it survives a reset.
#[unsafe(link_section = ".uninit.fault")]
static mut RECORD: MaybeUninit<Record> = MaybeUninit::uninit();
/// The last nonce, likewise.
#[unsafe(link_section = ".uninit.nonce")]
static mut NONCE: MaybeUninit<u32> = MaybeUninit::uninit();

fn die(fault: Fault) -> ! {
    cortex_m::interrupt::disable();
    make_safe();
    // SAFETY: interrupts are off and this never returns; any bit pattern is a record.
    unsafe { addr_of_mut!(RECORD).cast::<Record>().write_volatile(fault.record()) };
    SCB::sys_reset()
}

/// Reads and clears what the last life left behind; draws the nonce. Call once, at start.
pub fn report(cause: ResetCause, clock: ClockSource, entropy: u32) -> BootReport {
    // SAFETY: called once, before any interrupt is on; any bit pattern is a record, or a number.
    let (fault, last) = unsafe {
        let record = addr_of_mut!(RECORD).cast::<Record>();
        let fault = Fault::recall(record.read_volatile());
        record.write_volatile([0; 4]);
        (fault, addr_of_mut!(NONCE).cast::<u32>().read_volatile())
    };
    let nonce = stir(last, entropy);
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
