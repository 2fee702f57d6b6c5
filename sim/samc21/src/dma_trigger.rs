//! Requests of the peripherals to the DMA controller (data sheet: DMAC, CHCTRLB.TRIGSRC).

/// A trigger source, with its number in CHCTRLB.TRIGSRC.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum DmaTrigger {
    /// TSENS: result ready.
    TsensResrdy = 1,
    /// SERCOM0: byte received.
    Sercom0Rx = 2,
    /// SERCOM0: ready for a byte to send.
    Sercom0Tx = 3,
    /// SERCOM1: byte received.
    Sercom1Rx = 4,
    /// SERCOM1: ready for a byte to send.
    Sercom1Tx = 5,
    /// SERCOM2: byte received.
    Sercom2Rx = 6,
    /// SERCOM2: ready for a byte to send.
    Sercom2Tx = 7,
    /// SERCOM3: byte received.
    Sercom3Rx = 8,
    /// SERCOM3: ready for a byte to send.
    Sercom3Tx = 9,
    /// SERCOM4: byte received.
    Sercom4Rx = 10,
    /// SERCOM4: ready for a byte to send.
    Sercom4Tx = 11,
    /// SERCOM5: byte received.
    Sercom5Rx = 12,
    /// SERCOM5: ready for a byte to send.
    Sercom5Tx = 13,
    /// CAN0: debug request.
    Can0Debug = 14,
    /// CAN1: debug request.
    Can1Debug = 15,
    /// TCC0: overflow.
    Tcc0Ovf = 16,
    /// TCC0: compare/capture channel 0.
    Tcc0Mc0 = 17,
    /// TCC0: compare/capture channel 1.
    Tcc0Mc1 = 18,
    /// TCC0: compare/capture channel 2.
    Tcc0Mc2 = 19,
    /// TCC0: compare/capture channel 3.
    Tcc0Mc3 = 20,
    /// TCC1: overflow.
    Tcc1Ovf = 21,
    /// TCC1: compare/capture channel 0.
    Tcc1Mc0 = 22,
    /// TCC1: compare/capture channel 1.
    Tcc1Mc1 = 23,
    /// TCC2: overflow.
    Tcc2Ovf = 24,
    /// TCC2: compare/capture channel 0.
    Tcc2Mc0 = 25,
    /// TCC2: compare/capture channel 1.
    Tcc2Mc1 = 26,
    /// TC0: overflow.
    Tc0Ovf = 27,
    /// TC0: compare/capture channel 0.
    Tc0Mc0 = 28,
    /// TC0: compare/capture channel 1.
    Tc0Mc1 = 29,
    /// TC1: overflow.
    Tc1Ovf = 30,
    /// TC1: compare/capture channel 0.
    Tc1Mc0 = 31,
    /// TC1: compare/capture channel 1.
    Tc1Mc1 = 32,
    /// TC2: overflow.
    Tc2Ovf = 33,
    /// TC2: compare/capture channel 0.
    Tc2Mc0 = 34,
    /// TC2: compare/capture channel 1.
    Tc2Mc1 = 35,
    /// TC3: overflow.
    Tc3Ovf = 36,
    /// TC3: compare/capture channel 0.
    Tc3Mc0 = 37,
    /// TC3: compare/capture channel 1.
    Tc3Mc1 = 38,
    /// TC4: overflow.
    Tc4Ovf = 39,
    /// TC4: compare/capture channel 0.
    Tc4Mc0 = 40,
    /// TC4: compare/capture channel 1.
    Tc4Mc1 = 41,
    /// ADC0: result ready.
    Adc0Resrdy = 42,
    /// ADC1: result ready.
    Adc1Resrdy = 43,
    /// SDADC: result ready.
    SdadcResrdy = 44,
    /// DAC: buffer empty.
    DacEmpty = 45,
    /// PTC: end of conversion.
    PtcEoc = 46,
    /// PTC: window comparison.
    PtcWcomp = 47,
    /// PTC: sequence.
    PtcSeq = 48,
}

impl DmaTrigger {
    /// The trigger's bit in a set of triggers.
    pub const fn bit(self) -> u64 {
        1 << self as u64
    }
}
