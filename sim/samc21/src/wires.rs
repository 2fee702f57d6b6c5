//! Everything that crosses the package: pins, voltages, serial lines, CAN.
//!
//! The robot simulation reads and writes this between slices of emulated time; the peripheral models read and write it
//! while the chip runs. Neither side calls the other.

use std::any::Any;
use std::collections::VecDeque;

use crate::Cycles;
pub use crate::pins::Pins;

/// A byte on a serial line, and how it arrived.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct UartByte {
    /// When its stop bit ended.
    pub at: Cycles,
    /// The data bits.
    pub byte: u8,
    /// The receiver saw no stop bit.
    pub framing_error: bool,
}

/// The two wires of a SERCOM used as UART.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Uart {
    /// Bytes the outside sends: taken by the model when their time has come.
    pub to_chip: VecDeque<UartByte>,
    /// Bytes the chip has sent.
    pub from_chip: VecDeque<UartByte>,
}

/// A device on the SPI wires of a SERCOM.
pub trait SpiDevice: Any + Send {
    /// Chip select falls (`true`) or rises.
    fn select(&mut self, selected: bool, now: Cycles);
    /// Exchanges one byte while selected.
    fn exchange(&mut self, byte: u8, now: Cycles) -> u8;
    /// A copy, for snapshots.
    fn boxed_clone(&self) -> Box<dyn SpiDevice>;
}

/// An SPI device and how it is selected.
pub struct SpiLink {
    /// The device.
    pub device: Box<dyn SpiDevice>,
    /// Group and number of the pin that selects it while low; `None`: the SERCOM's own select.
    pub select: Option<(usize, u8)>,
    /// The device is selected.
    pub selected: bool,
}

impl SpiLink {
    /// A device selected by a low level on a pin of a group (0: PA, 1: PB).
    pub fn new(device: impl SpiDevice + 'static, select: (usize, u8)) -> Self {
        SpiLink { device: Box::new(device), select: Some(select), selected: false }
    }

    /// The device, if it is a `T`.
    pub fn device_mut<T: SpiDevice>(&mut self) -> Option<&mut T> {
        let device: &mut dyn Any = &mut *self.device;
        device.downcast_mut()
    }

    /// Selects or deselects the device.
    pub fn set_selected(&mut self, selected: bool, now: Cycles) {
        if self.selected != selected {
            self.selected = selected;
            self.device.select(selected, now);
        }
    }
}

impl Clone for SpiLink {
    fn clone(&self) -> Self {
        SpiLink { device: self.device.boxed_clone(), ..*self }
    }
}

/// A device on the I²C wires of a SERCOM.
pub trait I2cDevice: Send {
    /// A start condition addresses `address`; whether the device acknowledges.
    fn start(&mut self, address: u8, read: bool, now: Cycles) -> bool;
    /// The chip writes one byte; whether the device acknowledges.
    fn write(&mut self, byte: u8, now: Cycles) -> bool;
    /// The chip reads one byte.
    fn read(&mut self, now: Cycles) -> u8;
    /// Stop condition.
    fn stop(&mut self, now: Cycles);
    /// A copy, for snapshots.
    fn boxed_clone(&self) -> Box<dyn I2cDevice>;
}

/// What a SERCOM's pads are wired to.
#[derive(Default)]
pub enum Serial {
    /// Nothing.
    #[default]
    Open,
    /// A UART partner.
    Uart(Uart),
    /// An SPI device.
    Spi(SpiLink),
    /// An I²C device.
    I2c(Box<dyn I2cDevice>),
}

impl Clone for Serial {
    fn clone(&self) -> Self {
        match self {
            Serial::Open => Serial::Open,
            Serial::Uart(uart) => Serial::Uart(uart.clone()),
            Serial::Spi(link) => Serial::Spi(link.clone()),
            Serial::I2c(device) => Serial::I2c(device.boxed_clone()),
        }
    }
}

impl std::fmt::Debug for Serial {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Serial::Open => "Open",
            Serial::Uart(_) => "Uart",
            Serial::Spi(_) => "Spi",
            Serial::I2c(_) => "I2c",
        })
    }
}

/// Output of one TCC waveform channel.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Pwm {
    /// Share of the period that the output is high, 0 to 1.
    pub duty: f32,
    /// Period in 48 MHz ticks, zero while the counter stands.
    pub period: u32,
    /// The counter drives the output; otherwise whatever else is connected decides.
    pub driven: bool,
    /// A fault holds the output at its safe level.
    pub faulted: bool,
}

/// A CAN or CAN-FD frame on the wire.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct CanFrame {
    /// 11-bit identifier, or 29-bit when `extended`.
    pub id: u32,
    /// 29-bit identifier.
    pub extended: bool,
    /// FD frame format.
    pub fd: bool,
    /// Data phase at the faster bit rate.
    pub bit_rate_switch: bool,
    /// The sender was error passive.
    pub error_state: bool,
    /// Remote frame.
    pub remote: bool,
    /// Payload bytes in use, 0 to 64.
    pub length: u8,
    /// The payload; bytes beyond `length` are zero.
    pub data: [u8; 64],
}

/// An error as the protocol classifies it; the value is M_CAN's last error code (PSR.LEC).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum CanError {
    /// Six equal bits where stuffing forbids them.
    Stuff = 1,
    /// A fixed part of the frame had the wrong level.
    Form = 2,
    /// Nobody acknowledged.
    Acknowledge = 3,
    /// Sent recessive, saw dominant.
    Bit1 = 4,
    /// Sent dominant, saw recessive.
    Bit0 = 5,
    /// The check sum was wrong.
    Crc = 6,
}

/// What the bus told a CAN controller.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum CanEvent {
    /// The sequences of recessive bits asked for in [`CanPort::joining`] have passed.
    Joined,
    /// Somebody else's frame ended without error.
    Received(CanFrame),
    /// The frame in [`CanPort::offered`] was sent and acknowledged.
    Sent,
    /// The frame in [`CanPort::offered`] lost arbitration; it stays offered.
    ArbitrationLost,
    /// An error ended the transmission or reception in progress.
    Error {
        /// What was wrong.
        error: CanError,
        /// The controller was sending.
        sending: bool,
        /// After the bit rate switch.
        data_phase: bool,
        /// What it adds to the error counter of the role (ISO 11898-1, 12.1.4.2): 8 for a sender, none for an
        /// error-passive one that nobody answered; 1 for a receiver, 8 more if it was the first to see the error.
        weight: u16,
    },
}

/// Bit timing of a controller, in ticks of 48 MHz.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct CanTiming {
    /// One bit of the arbitration phase.
    pub nominal: u32,
    /// Its start to its sample point.
    pub nominal_sample: u32,
    /// One bit of the data phase after the bit rate switch.
    pub data: u32,
    /// Its start to its sample point.
    pub data_sample: u32,
}

/// A CAN controller's connection to the shared bus. The bus runs between slices, the controller inside them.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct CanPort {
    /// Set by the controller while it is connected to the bus (not in INIT).
    pub timing: Option<CanTiming>,
    /// Set by the controller: sequences of 11 recessive bits to wait for before it takes part. Counted down by the bus.
    pub joining: u16,
    /// Set by the controller: it understands FD frames.
    pub fd: bool,
    /// Set by the controller: it only listens, without acknowledging and without error flags.
    pub silent: bool,
    /// Set by the controller: it is error passive.
    pub passive: bool,
    /// The frame the controller wants to send next, and since when: its highest-priority pending one.
    pub offered: Option<(Cycles, CanFrame)>,
    /// Set by the bus, with the time of each event; taken by the controller when that time has come.
    pub events: VecDeque<(Cycles, CanEvent)>,
    /// Set by the bus while a frame that `offered` started is on the wire: cancelling it is too late.
    pub transmitting: bool,
}

impl CanPort {
    /// Takes part in the traffic.
    pub fn takes_part(&self) -> bool {
        self.timing.is_some() && self.joining == 0
    }

    /// The controller leaves the bus: what is under way is lost.
    pub fn leave(&mut self) {
        *self = CanPort::default();
    }
}

/// All wires of a chip.
#[derive(Clone, Debug, Default)]
pub struct Wires {
    /// PA and PB.
    pub pins: [Pins; 2],
    /// Voltage at each positive input of ADC0 and ADC1 (AIN0 to AIN11), V.
    pub analog: [[f32; 12]; 2],
    /// The watch crystal does not oscillate.
    pub crystal_fails: bool,
    /// Supply and ADC reference (VDDANA), V.
    pub supply: f32,
    /// Waveform outputs of TCC0, TCC1, TCC2.
    pub pwm: [[Pwm; 8]; 3],
    /// What SERCOM0 to SERCOM5 are wired to.
    pub serial: [Serial; 6],
    /// CAN0 and CAN1.
    pub can: [CanPort; 2],
    /// The outside has changed an input: set it after a change, so that edge-sensitive models look again.
    pub changed: bool,
}

impl Wires {
    /// Tells SPI devices whose select pin has changed. To be called after the chip has moved its pins.
    pub(crate) fn follow_selects(&mut self, now: Cycles) {
        for serial in &mut self.serial {
            if let Serial::Spi(link) = serial
                && let Some((group, pin)) = link.select
            {
                // The board pulls the line up.
                let pins = &self.pins[group];
                let low = (pins.seen() | pins.floating()) >> pin & 1 == 0;
                link.set_selected(low, now);
            }
        }
    }

    /// The chip lets go of everything it drives, as in reset. What the outside drives stays.
    pub(crate) fn release(&mut self) {
        for pins in &mut self.pins {
            pins.release();
        }
        self.pwm = Default::default();
        for can in &mut self.can {
            can.leave();
        }
    }
}
