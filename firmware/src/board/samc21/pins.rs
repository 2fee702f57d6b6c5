//! Pins and what they are switched to (data sheet: "I/O Multiplexing and Considerations", "PORT").

/// Pin group.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Group {
    /// PA.
    A,
    /// PB.
    B,
}

/// One pin.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Pin {
    /// Group.
    pub group: Group,
    /// Number within the group, 0 to 31.
    pub number: u8,
}

/// PA`number`.
pub const fn pa(number: u8) -> Pin {
    assert!(number < 32);
    Pin { group: Group::A, number }
}

/// PB`number`.
pub const fn pb(number: u8) -> Pin {
    assert!(number < 32);
    Pin { group: Group::B, number }
}

/// What drives or reads a pin.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Function {
    /// External interrupts.
    A,
    /// Analogue.
    B,
    /// SERCOM.
    C,
    /// SERCOM, alternative.
    D,
    /// Timers.
    E,
    /// TCC.
    F,
    /// CAN.
    G,
    /// No peripheral: an output driven by PORT.
    Output,
    /// No peripheral: an input with pull-up.
    Input,
}

impl Pin {
    /// Whether both are the same pin.
    pub const fn is(self, other: Pin) -> bool {
        self.group as u8 == other.group as u8 && self.number == other.number
    }

    /// The pin's bit in its group's registers.
    pub const fn mask(self) -> u32 {
        1 << self.number
    }
}

#[cfg(all(feature = "samc21", target_os = "none"))]
mod driver {
    use super::super::regs::port::{GROUP_STRIDE, Group as Registers, MmioGroup, PORT_IOBUS, PinCfg, Pmux};
    use super::{Function, Pin};
    use arbitrary_int::u4;
    use core::convert::Infallible;
    use embedded_hal::digital::{ErrorType, OutputPin};

    impl Pin {
        fn registers(self) -> MmioGroup<'static> {
            // SAFETY: both groups lie there. Writes are to this pin's own bytes or by set and clear registers, so they
            // disturb no other pin; two pins that share a PMUX byte are switched only while setting up.
            unsafe { Registers::new_mmio_at(PORT_IOBUS + GROUP_STRIDE * self.group as usize) }
        }

        /// Switches the pin. An output starts low.
        pub fn switch(self, function: Function) {
            let mut port = self.registers();
            let n = usize::from(self.number);
            let plain = PinCfg::ZERO;
            // The index is below 32 by construction, so nothing is refused.
            let _ = match function {
                Function::Output => {
                    port.write_outclr(self.mask());
                    port.write_dirset(self.mask());
                    port.write_pincfg(n, plain)
                }
                Function::Input => {
                    port.write_dirclr(self.mask());
                    port.write_outset(self.mask());
                    port.write_pincfg(n, plain.with_inen(true).with_pullen(true))
                }
                peripheral => {
                    let code = u4::new(peripheral as u8 & 15);
                    let change = |mux: Pmux| if n % 2 == 0 { mux.with_pmuxe(code) } else { mux.with_pmuxo(code) };
                    let _ = port.modify_pmux(n / 2, change);
                    port.write_pincfg(n, plain.with_pmuxen(true))
                }
            };
        }

        /// Drives an output.
        pub fn set(self, high: bool) {
            let mut port = self.registers();
            if high { port.write_outset(self.mask()) } else { port.write_outclr(self.mask()) }
        }

        /// Reads an input.
        pub fn is_high(self) -> bool {
            self.registers().read_in_() & self.mask() != 0
        }
    }

    /// An output for drivers that speak embedded-hal.
    pub struct Output(Pin);

    impl Output {
        /// Makes `pin` an output, low or high.
        pub fn new(pin: Pin, high: bool) -> Output {
            pin.switch(Function::Output);
            pin.set(high);
            Output(pin)
        }
    }

    impl ErrorType for Output {
        type Error = Infallible;
    }

    impl OutputPin for Output {
        fn set_low(&mut self) -> Result<(), Infallible> {
            self.0.set(false);
            Ok(())
        }

        fn set_high(&mut self) -> Result<(), Infallible> {
            self.0.set(true);
            Ok(())
        }
    }
}

#[cfg(all(feature = "samc21", target_os = "none"))]
pub use driver::Output;
