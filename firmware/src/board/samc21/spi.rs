//! SPI for the IMU: SERCOM1 on the EXT1 header, mode 0, 6 MHz (data sheet: "SERCOM SPI").
//!
//! A sample is 14 bytes, 19 µs: waiting for it in place costs less than any hand-over. Every wait ends by itself.

use arbitrary_int::u3;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::{Error, ErrorKind, ErrorType, Operation, SpiDevice};

use super::clocks::{self, CPU_HZ, Channel, Generator};
use super::pins::Output;
use super::regs::sercom::*;
use super::wiring::{IMU_MISO, IMU_MOSI, IMU_SCK, IMU_SELECT};

const RATE_HZ: u32 = 6_000_000;
const BAUD: u32 = CPU_HZ / (2 * RATE_HZ) - 1;
const _: () = assert!(BAUD < 256 && RATE_HZ * 2 * (BAUD + 1) == CPU_HZ);
/// Polls for one byte: some hundred times what it takes.
const PATIENCE: u32 = 10_000;

/// The bus never became ready.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Timeout;

impl Error for Timeout {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

/// The bus with its one device.
pub struct Spi {
    select: Output,
}

fn sercom() -> MmioSpi<'static> {
    // SAFETY: SERCOM1 lies there and belongs to the one `Spi`.
    unsafe { super::regs::sercom::Spi::new_mmio_at(SERCOM1) }
}

impl Spi {
    /// Sets the bus up, the device not selected. Call once.
    pub fn start() -> Spi {
        clocks::open_apb(|apb| apb.with_sercom1(true));
        clocks::feed(Channel::Sercom1Core, Generator::Cpu);
        let select = Output::new(IMU_SELECT.pin, true);
        for wire in [IMU_MISO, IMU_MOSI, IMU_SCK] {
            wire.pin.switch(wire.function);
        }
        let mut spi = sercom();
        spi.write_ctrla(SpiCtrlA::ZERO.with_swrst(true));
        while spi.read_syncbusy().swrst() {}
        let control = SpiCtrlA::ZERO.with_mode(Mode::SpiMaster).with_dopo(DOPO_2_3).with_dipo(Pad::Pad0);
        spi.write_ctrla(control);
        spi.write_baud(BAUD as u8);
        spi.write_ctrlb(SpiCtrlB::ZERO.with_chsize(u3::new(0)).with_rxen(true));
        while spi.read_syncbusy().ctrlb() {}
        spi.write_ctrla(control.with_enable(true));
        while spi.read_syncbusy().enable() {}
        Spi { select }
    }

    fn exchange(&mut self, out: u8) -> Result<u8, Timeout> {
        sercom().write_data(out.into());
        self.received()
    }

    fn received(&mut self) -> Result<u8, Timeout> {
        let mut spi = sercom();
        for _ in 0..PATIENCE {
            if spi.read_intflag().rxc() {
                return Ok(spi.read_data() as u8);
            }
        }
        Err(Timeout)
    }

    /// Reads with the next byte always waiting behind the one on the wire, which so never pauses.
    fn read(&mut self, into: &mut [u8]) -> Result<(), Timeout> {
        let mut to_send = into.len();
        let mut send_next = || {
            if to_send > 0 {
                sercom().write_data(0);
                to_send -= 1;
            }
        };
        send_next();
        for byte in into {
            // The byte before has left its buffer: this one is on the wire, or behind it.
            send_next();
            *byte = self.received()?;
        }
        Ok(())
    }

    fn operate(&mut self, operation: &mut Operation<'_, u8>) -> Result<(), Timeout> {
        match operation {
            Operation::Read(into) => self.read(into),
            Operation::Write(bytes) => bytes.iter().try_for_each(|byte| self.exchange(*byte).map(drop)),
            Operation::Transfer(into, bytes) => {
                let padded = bytes.iter().copied().chain(core::iter::repeat(0));
                let length = into.len().max(bytes.len());
                for (index, byte) in padded.take(length).enumerate() {
                    let got = self.exchange(byte)?;
                    if let Some(slot) = into.get_mut(index) {
                        *slot = got;
                    }
                }
                Ok(())
            }
            Operation::TransferInPlace(bytes) => {
                bytes.iter_mut().try_for_each(|byte| self.exchange(*byte).map(|got| *byte = got))
            }
            Operation::DelayNs(ns) => {
                cortex_m::asm::delay(ns.div_ceil(1000).saturating_mul(CPU_HZ / 1_000_000));
                Ok(())
            }
        }
    }
}

impl ErrorType for Spi {
    type Error = Timeout;
}

impl SpiDevice for Spi {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Timeout> {
        let Ok(()) = self.select.set_low();
        let result = operations.iter_mut().try_for_each(|operation| self.operate(operation));
        let Ok(()) = self.select.set_high();
        result
    }
}

/// Waiting by counting cycles; for setting up.
pub struct Delay;

impl embedded_hal::delay::DelayNs for Delay {
    fn delay_ns(&mut self, ns: u32) {
        cortex_m::asm::delay(ns.div_ceil(1000).saturating_mul(CPU_HZ / 1_000_000));
    }
}
