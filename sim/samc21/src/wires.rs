//! Everything that crosses the package: pins, voltages, serial lines, CAN.
//!
//! The robot simulation reads and writes this between slices of emulated time; the peripheral models read and write it
//! while the chip runs. Neither side calls the other.

use std::collections::VecDeque;

use crate::Cycles;

/// One group of 32 port pins, PA or PB.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Pins {
    /// Pins that the outside drives.
    pub driven: u32,
    /// The level the outside drives onto them.
    pub level: u32,
    /// Pins that the chip drives (PORT.DIR, or a peripheral through PMUX).
    pub output: u32,
    /// The level the chip drives onto them.
    pub output_level: u32,
}

impl Pins {
    /// The level seen on the wire: what the chip drives wins over what the outside drives, else low.
    pub const fn seen(&self) -> u32 {
        (self.output & self.output_level) | (!self.output & self.driven & self.level)
    }

    /// Drives pin `pin` from outside.
    pub fn drive(&mut self, pin: u8, high: bool) {
        self.driven |= 1 << pin;
        self.level = self.level & !(1 << pin) | u32::from(high) << pin;
    }
}

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
pub trait SpiDevice: Send {
    /// Chip select falls (`true`) or rises.
    fn select(&mut self, selected: bool, now: Cycles);
    /// Exchanges one byte while selected.
    fn exchange(&mut self, byte: u8, now: Cycles) -> u8;
    /// A copy, for snapshots.
    fn boxed_clone(&self) -> Box<dyn SpiDevice>;
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
    Spi(Box<dyn SpiDevice>),
    /// An I²C device.
    I2c(Box<dyn I2cDevice>),
}

impl Clone for Serial {
    fn clone(&self) -> Self {
        match self {
            Serial::Open => Serial::Open,
            Serial::Uart(uart) => Serial::Uart(uart.clone()),
            Serial::Spi(device) => Serial::Spi(device.boxed_clone()),
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
    /// A fault input holds the output at its safe level.
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

/// What the bus told a CAN controller.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum CanEvent {
    /// Somebody else's frame ended without error.
    Received(CanFrame),
    /// The frame in [`CanPort::offered`] was sent and acknowledged.
    Sent,
    /// The frame in [`CanPort::offered`] lost arbitration; it stays offered.
    ArbitrationLost,
    /// An error frame ended the transmission or reception in progress (M_CAN last error code, PSR.LEC).
    Error(u8),
}

/// Bit timing of a controller, in ticks of 48 MHz per bit.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct CanTiming {
    /// Arbitration phase.
    pub nominal: u32,
    /// Data phase after the bit rate switch.
    pub data: u32,
}

/// A CAN controller's connection to the shared bus. The bus runs between slices, the controller inside them.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct CanPort {
    /// Set by the controller while it takes part in bus traffic (not in INIT, not bus-off).
    pub timing: Option<CanTiming>,
    /// The frame the controller wants to send next, and since when: its highest-priority pending one.
    pub offered: Option<(Cycles, CanFrame)>,
    /// Set by the bus, with the time of each event; taken by the controller when that time has come.
    pub events: VecDeque<(Cycles, CanEvent)>,
    /// Set by the bus while a frame that `offered` started is on the wire: cancelling it is too late.
    pub transmitting: bool,
}

/// All wires of a chip.
#[derive(Clone, Debug, Default)]
pub struct Wires {
    /// PA and PB.
    pub pins: [Pins; 2],
    /// Voltage at each positive input of ADC0 and ADC1 (AIN0 to AIN11), V.
    pub analog: [[f32; 12]; 2],
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
    /// The chip lets go of everything it drives, as in reset. What the outside drives stays.
    pub(crate) fn release(&mut self) {
        for pins in &mut self.pins {
            (pins.output, pins.output_level) = (0, 0);
        }
        self.pwm = Default::default();
        for can in &mut self.can {
            (can.timing, can.offered) = (None, None);
        }
    }
}
