//! The host link: SERCOM4 as a UART at 1 Mbaud, on the board's virtual COM port (data sheet: "SERCOM USART").
//!
//! ```text
//!  RX  PB11 ─► SERCOM4 ─► DMA ─► ring of 256 bytes, round and round ─► `read`, each millisecond
//!  TX  PB10 ◄─ SERCOM4 ◄─ DMA ◄─ one frame of up to 204 bytes       ◄─ `send`, when the last one is gone
//! ```
//!
//! No interrupt in either direction. The chip has none for an idle line, so idleness needs no detecting: whoever asks gets
//! what has arrived until then, a frame is never held back for the next byte. At most 100 bytes come in a millisecond; the
//! ring holds two and a half. Whoever asks too late gets torn frames, which the check sum refuses.
//!
//! The rate is exact: 48 MHz / (16 · 3). What the virtual COM port of the board makes of it: UNVERIFIED on silicon.

use core::cell::UnsafeCell;

use arbitrary_int::{u3, u13};

use super::clocks::{self, CPU_HZ, Channel, Generator};
use super::dma;
use super::regs::dmac::{Lvl, triggers};
use super::regs::sercom::*;
use super::wiring::{HOST_RX, HOST_TX};

/// Bits per second.
pub const BAUD: u32 = 1_000_000;
const DIVISOR: u32 = CPU_HZ / (16 * BAUD);
const _: () = assert!(DIVISOR * 16 * BAUD == CPU_HZ, "the rate would not be exact");

const RX_CHANNEL: u8 = 1;
const TX_CHANNEL: u8 = 2;
/// A power of two, so that positions wrap cheaply.
const RING: usize = 256;
/// Longest frame.
const FRAME: usize = sarah_protocol::frame::MAX_ENCODED;

struct Buffer<const N: usize>(UnsafeCell<[u8; N]>);
// SAFETY: RX is written by DMA alone and read by the one `Uart`; TX is written by it while DMA stands still.
unsafe impl<const N: usize> Sync for Buffer<N> {}
static RX: Buffer<RING> = Buffer(UnsafeCell::new([0; RING]));
static TX: Buffer<FRAME> = Buffer(UnsafeCell::new([0; FRAME]));

/// Both directions.
pub struct Uart {
    rx: dma::Channel,
    tx: dma::Channel,
    taken: usize,
    sending: bool,
}

fn sercom() -> MmioUsart<'static> {
    // SAFETY: SERCOM4 lies there and belongs to the one `Uart`; DMA only touches DATA.
    unsafe { Usart::new_mmio_at(SERCOM4) }
}

impl Uart {
    /// Starts listening; DMA is already running. Call once.
    pub fn start() -> Option<Uart> {
        clocks::open_apb(|apb| apb.with_sercom4(true));
        clocks::feed(Channel::Sercom4Core, Generator::Cpu);
        for wire in [HOST_TX, HOST_RX] {
            wire.pin.switch(wire.function);
        }
        let mut uart = sercom();
        uart.write_ctrla(UsartCtrlA::ZERO.with_swrst(true));
        while uart.read_syncbusy().swrst() {}
        let control = UsartCtrlA::ZERO
            .with_mode(Mode::UsartIntClk)
            .with_sampr(Sampr::XFractional16)
            .with_txpo(Txpo::Pad2)
            .with_rxpo(Pad::Pad3)
            .with_dord(true);
        uart.write_ctrla(control);
        uart.write_baud_frac_mode(BaudFracMode::ZERO.with_baud(u13::new(DIVISOR as u16)));
        uart.write_ctrlb(UsartCtrlB::ZERO.with_chsize(u3::new(0)).with_txen(true).with_rxen(true));
        while uart.read_syncbusy().ctrlb() {}
        uart.write_ctrla(control.with_enable(true));
        while uart.read_syncbusy().enable() {}

        // SAFETY: these channels are used here alone.
        let (mut rx, tx) = unsafe {
            let rx = dma::Channel::new(RX_CHANNEL, triggers::SERCOM4_RX, Lvl::Lvl2)?;
            (rx, dma::Channel::new(TX_CHANNEL, triggers::SERCOM4_TX, Lvl::Lvl1)?)
        };
        let ring = dma::Descriptor {
            control: dma::VALID | dma::DESTINATION_INCREMENTS,
            count: RING as u16,
            source: uart.pointer_to_data() as u32,
            destination: RX.0.get() as u32 + RING as u32,
            next: rx.first(),
        };
        // SAFETY: the ring is static and read with volatile reads only.
        unsafe { rx.start(ring) };
        Some(Uart { rx, tx, taken: 0, sending: false })
    }

    /// Takes what has arrived, at most `into` holds.
    pub fn read(&mut self, into: &mut [u8]) -> usize {
        let mut uart = sercom();
        let status = uart.read_status();
        if status.bufovf() || status.ferr() {
            // What was lost or broken fails its checksum.
            uart.write_status(status);
        }
        let arrived = RING - usize::from(self.rx.left()).min(RING);
        let mut count = 0;
        for slot in into {
            if self.taken == arrived % RING {
                break;
            }
            // SAFETY: the position is below RING. DMA may write elsewhere in the ring meanwhile, never tearing a byte.
            *slot = unsafe { RX.0.get().cast::<u8>().add(self.taken).read_volatile() };
            self.taken = (self.taken + 1) % RING;
            count += 1;
        }
        count
    }

    /// Whether [`Uart::send`] would take a frame.
    pub fn is_free(&mut self) -> bool {
        self.sending = self.sending && !self.tx.is_done();
        !self.sending
    }

    /// Begins to send. False, and nothing happens, while the last frame is still going out.
    pub fn send(&mut self, frame: &[u8]) -> bool {
        let length = frame.len();
        if length == 0 || length > FRAME || !self.is_free() {
            return false;
        }
        // SAFETY: the last transfer is done, so nobody reads the buffer, and the frame fits.
        unsafe { core::ptr::copy_nonoverlapping(frame.as_ptr(), TX.0.get().cast(), length) };
        let transfer = dma::Descriptor {
            control: dma::VALID | dma::SOURCE_INCREMENTS,
            count: length as u16,
            source: TX.0.get() as u32 + length as u32,
            destination: sercom().pointer_to_data() as u32,
            next: 0,
        };
        // SAFETY: the buffer is static and left alone until the transfer is done.
        unsafe { self.tx.start(transfer) };
        self.sending = true;
        true
    }
}
