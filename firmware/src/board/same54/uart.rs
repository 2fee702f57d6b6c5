//! The host link: SERCOM2 through the HAL at 1 Mbaud, on the debugger's virtual COM port (data sheet: "SERCOM USART";
//! user guide: "Virtual COM Port").
//!
//! ```text
//!  RX  PB24 ─► SERCOM2 ─► interrupt per byte ─► ring of 256 bytes      ─► `read`, each millisecond
//!  TX  PB25 ◄─ SERCOM2 ◄─ interrupt per byte ◄─ one frame of up to 204 ◄─ `send`, when the last one is gone
//! ```
//!
//! A byte takes 10 µs and its handler some dozens of cycles of 120 MHz: a few hundredths of the CPU in each direction.
//! The handlers preempt everything, so only a critical section delays them, and SERCOM holds two bytes meanwhile. A ring
//! that is full drops bytes: torn frames, which the check sum refuses.
//!
//! The rate is exact: 40 MHz / (16 · 2½). The debugger carries bytes only while the host's terminal asserts DTR (user
//! guide: "Embedded Debugger"). Whether it carries 1 Mbaud: UNVERIFIED on silicon.

use core::sync::atomic::{AtomicBool, AtomicU8, AtomicUsize, Ordering};

use atsamd_hal::gpio::{PB24, PB25};
use atsamd_hal::pac::{self, Interrupt, interrupt};
use atsamd_hal::sercom::Sercom2;
use atsamd_hal::sercom::uart::{self, Duplex, Flags, Status};

use super::{enable, priority};
use crate::board::coordinator::HostLink;

/// Bits per second.
pub const BAUD: u32 = 1_000_000;
/// A power of two.
const RING: usize = 256;
/// Longest frame.
const FRAME: usize = sarah_protocol::frame::MAX_ENCODED;

/// The pads the HAL checks.
pub type Pads = uart::PadsFromIds<Sercom2, PB24, PB25>;
/// The port, set up and enabled.
pub type Port = uart::Uart<uart::Config<Pads>, Duplex>;

/// Bytes received; `ARRIVED` is written by the interrupt alone, `TAKEN` by the task alone. Both count on and wrap.
static RX: [AtomicU8; RING] = [const { AtomicU8::new(0) }; RING];
static ARRIVED: AtomicUsize = AtomicUsize::new(0);
static TAKEN: AtomicUsize = AtomicUsize::new(0);
/// The frame going out: written by the task while `SENDING` is false, read by the interrupt while it is true.
static TX: [AtomicU8; FRAME] = [const { AtomicU8::new(0) }; FRAME];
static LENGTH: AtomicUsize = AtomicUsize::new(0);
static SENT: AtomicUsize = AtomicUsize::new(0);
static SENDING: AtomicBool = AtomicBool::new(false);

fn sercom() -> &'static pac::sercom0::UsartInt {
    // SAFETY: SERCOM2 lies there. The handlers below alone touch DATA, and INTENSET and INTENCLR need no reading first.
    unsafe { &*pac::Sercom2::ptr() }.usart_int()
}

/// A byte has come in.
#[interrupt]
fn SERCOM2_2() {
    let byte = sercom().data().read().bits() as u8;
    let arrived = ARRIVED.load(Ordering::Relaxed);
    if arrived.wrapping_sub(TAKEN.load(Ordering::Acquire)) < RING {
        if let Some(slot) = RX.get(arrived % RING) {
            slot.store(byte, Ordering::Relaxed);
        }
        ARRIVED.store(arrived.wrapping_add(1), Ordering::Release);
    }
}

/// There is room for a byte.
#[interrupt]
fn SERCOM2_0() {
    let sent = SENT.load(Ordering::Relaxed);
    match TX.get(sent) {
        Some(byte) if sent < LENGTH.load(Ordering::Relaxed) => {
            let byte = byte.load(Ordering::Relaxed);
            // SAFETY: any byte is allowed.
            sercom().data().write(|data| unsafe { data.bits(byte.into()) });
            SENT.store(sent + 1, Ordering::Relaxed);
        }
        _ => {
            sercom().intenclr().write(|off| off.dre().set_bit());
            SENDING.store(false, Ordering::Release);
        }
    }
}

/// Both directions.
pub struct Uart {
    port: Port,
}

impl Uart {
    /// Starts listening.
    pub fn start(mut port: Port) -> Uart {
        port.enable_interrupts(Flags::RXC);
        enable(Interrupt::SERCOM2_0, priority::BYTES);
        enable(Interrupt::SERCOM2_2, priority::BYTES);
        Uart { port }
    }
}

impl HostLink for Uart {
    fn read(&mut self, into: &mut [u8]) -> usize {
        let errors = self.port.read_status() & (Status::BUFOVF | Status::FERR);
        if !errors.is_empty() {
            // What they spoilt fails its checksum.
            self.port.clear_status(errors);
        }
        let mut taken = TAKEN.load(Ordering::Relaxed);
        let mut count = 0;
        let arrived = ARRIVED.load(Ordering::Acquire);
        for slot in into {
            if taken == arrived {
                break;
            }
            *slot = RX.get(taken % RING).map_or(0, |byte| byte.load(Ordering::Relaxed));
            taken = taken.wrapping_add(1);
            count += 1;
        }
        TAKEN.store(taken, Ordering::Release);
        count
    }

    fn is_free(&mut self) -> bool {
        !SENDING.load(Ordering::Acquire)
    }

    fn send(&mut self, frame: &[u8]) {
        if frame.is_empty() || frame.len() > FRAME || !self.is_free() {
            return;
        }
        for (slot, byte) in TX.iter().zip(frame) {
            slot.store(*byte, Ordering::Relaxed);
        }
        LENGTH.store(frame.len(), Ordering::Relaxed);
        SENT.store(0, Ordering::Relaxed);
        SENDING.store(true, Ordering::Release);
        self.port.enable_interrupts(Flags::DRE);
    }
}
