//! Interrupt lines of the peripherals (data sheet: "Nested Vector Interrupt Controller", interrupt line mapping).

/// A line into the NVIC, with its number.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Irq {
    /// The clock, power and access controllers: MCLK, OSCCTRL, OSC32KCTRL, PAC, SUPC.
    System = 0,
    /// WDT.
    Wdt = 1,
    /// RTC.
    Rtc = 2,
    /// EIC.
    Eic = 3,
    /// FREQM.
    Freqm = 4,
    /// TSENS.
    Tsens = 5,
    /// NVMCTRL.
    Nvmctrl = 6,
    /// DMAC.
    Dmac = 7,
    /// EVSYS.
    Evsys = 8,
    /// SERCOM0.
    Sercom0 = 9,
    /// SERCOM1.
    Sercom1 = 10,
    /// SERCOM2.
    Sercom2 = 11,
    /// SERCOM3.
    Sercom3 = 12,
    /// SERCOM4.
    Sercom4 = 13,
    /// SERCOM5.
    Sercom5 = 14,
    /// CAN0.
    Can0 = 15,
    /// CAN1.
    Can1 = 16,
    /// TCC0.
    Tcc0 = 17,
    /// TCC1.
    Tcc1 = 18,
    /// TCC2.
    Tcc2 = 19,
    /// TC0.
    Tc0 = 20,
    /// TC1.
    Tc1 = 21,
    /// TC2.
    Tc2 = 22,
    /// TC3.
    Tc3 = 23,
    /// TC4.
    Tc4 = 24,
    /// ADC0.
    Adc0 = 25,
    /// ADC1.
    Adc1 = 26,
    /// AC.
    Ac = 27,
    /// DAC.
    Dac = 28,
    /// SDADC.
    Sdadc = 29,
    /// PTC.
    Ptc = 30,
}

impl Irq {
    /// The line's bit in the NVIC's 32-bit registers.
    pub const fn bit(self) -> u32 {
        1 << self as u32
    }
}
