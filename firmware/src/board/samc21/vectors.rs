//! The interrupt lines (data sheet: "Nested Vector Interrupt Controller") and their vectors.
//!
//! A handler is a function named after its line under `#[cortex_m_rt::interrupt]`, with [`interrupt`] in scope. Lines
//! without one end in `DefaultHandler` by `device.x`.

macro_rules! interrupts {
    ($($number:literal $name:ident)*) => {
        /// Every interrupt line.
        #[derive(Clone, Copy, PartialEq, Eq, Debug)]
        #[repr(u16)]
        #[allow(clippy::upper_case_acronyms, missing_docs)]
        pub enum Interrupt { $($name = $number),* }

        /// Names and numbers.
        pub const ALL: &[(&str, u16)] = &[$((stringify!($name), $number)),*];

        #[cfg(target_os = "none")]
        mod table {
            unsafe extern "C" { $(fn $name();)* }

            #[unsafe(link_section = ".vector_table.interrupts")]
            #[unsafe(no_mangle)]
            static __INTERRUPTS: [Option<unsafe extern "C" fn()>; 32] = {
                let mut table: [Option<unsafe extern "C" fn()>; 32] = [None; 32];
                $(table[$number] = Some($name);)*
                table
            };
        }
    };
}

interrupts! {
    0 SYSTEM 1 WDT 2 RTC 3 EIC 4 FREQM 5 TSENS 6 NVMCTRL 7 DMAC 8 EVSYS
    9 SERCOM0 10 SERCOM1 11 SERCOM2 12 SERCOM3 13 SERCOM4 14 SERCOM5 15 CAN0 16 CAN1
    17 TCC0 18 TCC1 19 TCC2 20 TC0 21 TC1 22 TC2 23 TC3 24 TC4 25 ADC0 26 ADC1
    27 AC 28 DAC 29 SDADC 30 PTC
}

pub use Interrupt as interrupt;

// SAFETY: the number is the line in the NVIC and never changes.
#[cfg(target_os = "none")]
unsafe impl cortex_m::interrupt::InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

/// Who interrupts whom; the chip has four levels, lower numbers win.
pub mod priority {
    /// The control tick's timer: nothing delays it but a critical section.
    pub const TICK: u8 = 0x00;
    /// Control: the executor of its task, or the handler of its ticks.
    pub const CONTROL: u8 = 0x40;
    /// Time driver, CAN, DMA, UART, SPI: short handlers that wake slow tasks.
    pub const IO: u8 = 0x80;
}

/// Enables a line at a priority.
#[cfg(target_os = "none")]
pub fn enable(line: Interrupt, priority: u8) {
    // SAFETY: called while setting up, before the handler's line can fire; no critical section relies on masking.
    unsafe {
        cortex_m::Peripherals::steal().NVIC.set_priority(line, priority);
        cortex_m::peripheral::NVIC::unmask(line);
    }
}

#[cfg(test)]
mod tests {
    use super::super::regs::facts;
    use super::*;
    use std::collections::BTreeMap;

    #[test]
    fn every_handler_is_named_after_its_line() {
        let ours: BTreeMap<&str, i64> = ALL.iter().map(|(name, number)| (*name, i64::from(*number))).collect();
        assert_eq!(ours, facts::numbers("interrupts"));
    }

    #[test]
    fn the_linker_knows_every_name() {
        let provided: Vec<&str> = include_str!("device.x")
            .lines()
            .filter_map(|line| line.strip_prefix("PROVIDE(")?.strip_suffix(" = DefaultHandler);"))
            .collect();
        assert_eq!(provided, ALL.iter().map(|(name, _)| *name).collect::<Vec<_>>());
    }
}
