//! Which peripheral answers at which address, and the clock mask bit that lets it (data sheet: "Physical memory map",
//! "MCLK").

/// A peripheral instance of the ATSAMC21J18A.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Unit {
    /// At 0x4000_0000.
    Pac,
    /// At 0x4000_0400.
    Pm,
    /// At 0x4000_0800.
    Mclk,
    /// At 0x4000_0c00.
    Rstc,
    /// At 0x4000_1000.
    Oscctrl,
    /// At 0x4000_1400.
    Osc32kctrl,
    /// At 0x4000_1800.
    Supc,
    /// At 0x4000_1c00.
    Gclk,
    /// At 0x4000_2000.
    Wdt,
    /// At 0x4000_2400.
    Rtc,
    /// At 0x4000_2800.
    Eic,
    /// At 0x4000_2c00.
    Freqm,
    /// At 0x4000_3000.
    Tsens,
    /// At 0x4100_0000.
    Port,
    /// At 0x4100_2000.
    Dsu,
    /// At 0x4100_4000.
    Nvmctrl,
    /// At 0x4100_6000.
    Dmac,
    /// At 0x4100_8000.
    Mtb,
    /// At 0x4100_a000.
    Hmatrixhs,
    /// At 0x4200_0000.
    Evsys,
    /// At 0x4200_0400.
    Sercom0,
    /// At 0x4200_0800.
    Sercom1,
    /// At 0x4200_0c00.
    Sercom2,
    /// At 0x4200_1000.
    Sercom3,
    /// At 0x4200_1400.
    Sercom4,
    /// At 0x4200_1800.
    Sercom5,
    /// At 0x4200_1c00.
    Can0,
    /// At 0x4200_2000.
    Can1,
    /// At 0x4200_2400.
    Tcc0,
    /// At 0x4200_2800.
    Tcc1,
    /// At 0x4200_2c00.
    Tcc2,
    /// At 0x4200_3000.
    Tc0,
    /// At 0x4200_3400.
    Tc1,
    /// At 0x4200_3800.
    Tc2,
    /// At 0x4200_3c00.
    Tc3,
    /// At 0x4200_4000.
    Tc4,
    /// At 0x4200_4400.
    Adc0,
    /// At 0x4200_4800.
    Adc1,
    /// At 0x4200_4c00.
    Sdadc,
    /// At 0x4200_5000.
    Ac,
    /// At 0x4200_5400.
    Dac,
    /// At 0x4200_5800.
    Ptc,
    /// At 0x4200_5c00.
    Ccl,
    /// At 0x4800_0000.
    Divas,
}

/// The register of MCLK whose bit clocks a peripheral's bus interface.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Mask {
    /// AHBMASK.
    Ahb,
    /// APBAMASK.
    ApbA,
    /// APBBMASK.
    ApbB,
    /// APBCMASK.
    ApbC,
}

impl Unit {
    /// Every unit, in order of their addresses.
    pub const ALL: [Unit; Unit::COUNT] = [
        Unit::Pac,
        Unit::Pm,
        Unit::Mclk,
        Unit::Rstc,
        Unit::Oscctrl,
        Unit::Osc32kctrl,
        Unit::Supc,
        Unit::Gclk,
        Unit::Wdt,
        Unit::Rtc,
        Unit::Eic,
        Unit::Freqm,
        Unit::Tsens,
        Unit::Port,
        Unit::Dsu,
        Unit::Nvmctrl,
        Unit::Dmac,
        Unit::Mtb,
        Unit::Hmatrixhs,
        Unit::Evsys,
        Unit::Sercom0,
        Unit::Sercom1,
        Unit::Sercom2,
        Unit::Sercom3,
        Unit::Sercom4,
        Unit::Sercom5,
        Unit::Can0,
        Unit::Can1,
        Unit::Tcc0,
        Unit::Tcc1,
        Unit::Tcc2,
        Unit::Tc0,
        Unit::Tc1,
        Unit::Tc2,
        Unit::Tc3,
        Unit::Tc4,
        Unit::Adc0,
        Unit::Adc1,
        Unit::Sdadc,
        Unit::Ac,
        Unit::Dac,
        Unit::Ptc,
        Unit::Ccl,
        Unit::Divas,
    ];

    /// Number of units.
    pub const COUNT: usize = 44;

    /// First address of its registers.
    pub const fn base(self) -> u32 {
        match self {
            Unit::Pac => 0x4000_0000,
            Unit::Pm => 0x4000_0400,
            Unit::Mclk => 0x4000_0800,
            Unit::Rstc => 0x4000_0c00,
            Unit::Oscctrl => 0x4000_1000,
            Unit::Osc32kctrl => 0x4000_1400,
            Unit::Supc => 0x4000_1800,
            Unit::Gclk => 0x4000_1c00,
            Unit::Wdt => 0x4000_2000,
            Unit::Rtc => 0x4000_2400,
            Unit::Eic => 0x4000_2800,
            Unit::Freqm => 0x4000_2c00,
            Unit::Tsens => 0x4000_3000,
            Unit::Port => 0x4100_0000,
            Unit::Dsu => 0x4100_2000,
            Unit::Nvmctrl => 0x4100_4000,
            Unit::Dmac => 0x4100_6000,
            Unit::Mtb => 0x4100_8000,
            Unit::Hmatrixhs => 0x4100_a000,
            Unit::Evsys => 0x4200_0000,
            Unit::Sercom0 => 0x4200_0400,
            Unit::Sercom1 => 0x4200_0800,
            Unit::Sercom2 => 0x4200_0c00,
            Unit::Sercom3 => 0x4200_1000,
            Unit::Sercom4 => 0x4200_1400,
            Unit::Sercom5 => 0x4200_1800,
            Unit::Can0 => 0x4200_1c00,
            Unit::Can1 => 0x4200_2000,
            Unit::Tcc0 => 0x4200_2400,
            Unit::Tcc1 => 0x4200_2800,
            Unit::Tcc2 => 0x4200_2c00,
            Unit::Tc0 => 0x4200_3000,
            Unit::Tc1 => 0x4200_3400,
            Unit::Tc2 => 0x4200_3800,
            Unit::Tc3 => 0x4200_3c00,
            Unit::Tc4 => 0x4200_4000,
            Unit::Adc0 => 0x4200_4400,
            Unit::Adc1 => 0x4200_4800,
            Unit::Sdadc => 0x4200_4c00,
            Unit::Ac => 0x4200_5000,
            Unit::Dac => 0x4200_5400,
            Unit::Ptc => 0x4200_5800,
            Unit::Ccl => 0x4200_5c00,
            Unit::Divas => 0x4800_0000,
        }
    }

    /// Its name in the data sheet.
    pub const fn name(self) -> &'static str {
        match self {
            Unit::Pac => "PAC",
            Unit::Pm => "PM",
            Unit::Mclk => "MCLK",
            Unit::Rstc => "RSTC",
            Unit::Oscctrl => "OSCCTRL",
            Unit::Osc32kctrl => "OSC32KCTRL",
            Unit::Supc => "SUPC",
            Unit::Gclk => "GCLK",
            Unit::Wdt => "WDT",
            Unit::Rtc => "RTC",
            Unit::Eic => "EIC",
            Unit::Freqm => "FREQM",
            Unit::Tsens => "TSENS",
            Unit::Port => "PORT",
            Unit::Dsu => "DSU",
            Unit::Nvmctrl => "NVMCTRL",
            Unit::Dmac => "DMAC",
            Unit::Mtb => "MTB",
            Unit::Hmatrixhs => "HMATRIXHS",
            Unit::Evsys => "EVSYS",
            Unit::Sercom0 => "SERCOM0",
            Unit::Sercom1 => "SERCOM1",
            Unit::Sercom2 => "SERCOM2",
            Unit::Sercom3 => "SERCOM3",
            Unit::Sercom4 => "SERCOM4",
            Unit::Sercom5 => "SERCOM5",
            Unit::Can0 => "CAN0",
            Unit::Can1 => "CAN1",
            Unit::Tcc0 => "TCC0",
            Unit::Tcc1 => "TCC1",
            Unit::Tcc2 => "TCC2",
            Unit::Tc0 => "TC0",
            Unit::Tc1 => "TC1",
            Unit::Tc2 => "TC2",
            Unit::Tc3 => "TC3",
            Unit::Tc4 => "TC4",
            Unit::Adc0 => "ADC0",
            Unit::Adc1 => "ADC1",
            Unit::Sdadc => "SDADC",
            Unit::Ac => "AC",
            Unit::Dac => "DAC",
            Unit::Ptc => "PTC",
            Unit::Ccl => "CCL",
            Unit::Divas => "DIVAS",
        }
    }

    /// The MCLK mask bit of its bus interface; `None` where the data sheet has no such bit.
    pub const fn clock_mask(self) -> Option<(Mask, u32)> {
        Some(match self {
            Unit::Pac => (Mask::ApbA, 0),
            Unit::Pm => (Mask::ApbA, 1),
            Unit::Mclk => (Mask::ApbA, 2),
            Unit::Rstc => (Mask::ApbA, 3),
            Unit::Oscctrl => (Mask::ApbA, 4),
            Unit::Osc32kctrl => (Mask::ApbA, 5),
            Unit::Supc => (Mask::ApbA, 6),
            Unit::Gclk => (Mask::ApbA, 7),
            Unit::Wdt => (Mask::ApbA, 8),
            Unit::Rtc => (Mask::ApbA, 9),
            Unit::Eic => (Mask::ApbA, 10),
            Unit::Freqm => (Mask::ApbA, 11),
            Unit::Tsens => (Mask::ApbA, 12),
            Unit::Port => (Mask::ApbB, 0),
            Unit::Dsu => (Mask::ApbB, 1),
            Unit::Nvmctrl => (Mask::ApbB, 2),
            Unit::Dmac => (Mask::Ahb, 7),
            Unit::Mtb => return None,
            Unit::Hmatrixhs => (Mask::ApbB, 5),
            Unit::Evsys => (Mask::ApbC, 0),
            Unit::Sercom0 => (Mask::ApbC, 1),
            Unit::Sercom1 => (Mask::ApbC, 2),
            Unit::Sercom2 => (Mask::ApbC, 3),
            Unit::Sercom3 => (Mask::ApbC, 4),
            Unit::Sercom4 => (Mask::ApbC, 5),
            Unit::Sercom5 => (Mask::ApbC, 6),
            Unit::Can0 => (Mask::Ahb, 8),
            Unit::Can1 => (Mask::Ahb, 9),
            Unit::Tcc0 => (Mask::ApbC, 9),
            Unit::Tcc1 => (Mask::ApbC, 10),
            Unit::Tcc2 => (Mask::ApbC, 11),
            Unit::Tc0 => (Mask::ApbC, 12),
            Unit::Tc1 => (Mask::ApbC, 13),
            Unit::Tc2 => (Mask::ApbC, 14),
            Unit::Tc3 => (Mask::ApbC, 15),
            Unit::Tc4 => (Mask::ApbC, 16),
            Unit::Adc0 => (Mask::ApbC, 17),
            Unit::Adc1 => (Mask::ApbC, 18),
            Unit::Sdadc => (Mask::ApbC, 19),
            Unit::Ac => (Mask::ApbC, 20),
            Unit::Dac => (Mask::ApbC, 21),
            Unit::Ptc => (Mask::ApbC, 22),
            Unit::Ccl => (Mask::ApbC, 23),
            Unit::Divas => (Mask::Ahb, 12),
        })
    }

    /// The unit at `address`, and the offset into its registers.
    ///
    /// Bridge A and C give every unit 1 KiB, bridge B 8 KiB; DIVAS and PORT also answer on the single-cycle I/O bus.
    pub const fn at(address: u32) -> Option<(Unit, u32)> {
        let page = address & !0x3ff;
        let unit = match address >> 24 {
            0x40 | 0x42 => match page {
                0x4000_0000 => Unit::Pac,
                0x4000_0400 => Unit::Pm,
                0x4000_0800 => Unit::Mclk,
                0x4000_0c00 => Unit::Rstc,
                0x4000_1000 => Unit::Oscctrl,
                0x4000_1400 => Unit::Osc32kctrl,
                0x4000_1800 => Unit::Supc,
                0x4000_1c00 => Unit::Gclk,
                0x4000_2000 => Unit::Wdt,
                0x4000_2400 => Unit::Rtc,
                0x4000_2800 => Unit::Eic,
                0x4000_2c00 => Unit::Freqm,
                0x4000_3000 => Unit::Tsens,
                0x4200_0000 => Unit::Evsys,
                0x4200_0400 => Unit::Sercom0,
                0x4200_0800 => Unit::Sercom1,
                0x4200_0c00 => Unit::Sercom2,
                0x4200_1000 => Unit::Sercom3,
                0x4200_1400 => Unit::Sercom4,
                0x4200_1800 => Unit::Sercom5,
                0x4200_1c00 => Unit::Can0,
                0x4200_2000 => Unit::Can1,
                0x4200_2400 => Unit::Tcc0,
                0x4200_2800 => Unit::Tcc1,
                0x4200_2c00 => Unit::Tcc2,
                0x4200_3000 => Unit::Tc0,
                0x4200_3400 => Unit::Tc1,
                0x4200_3800 => Unit::Tc2,
                0x4200_3c00 => Unit::Tc3,
                0x4200_4000 => Unit::Tc4,
                0x4200_4400 => Unit::Adc0,
                0x4200_4800 => Unit::Adc1,
                0x4200_4c00 => Unit::Sdadc,
                0x4200_5000 => Unit::Ac,
                0x4200_5400 => Unit::Dac,
                0x4200_5800 => Unit::Ptc,
                0x4200_5c00 => Unit::Ccl,
                _ => return None,
            },
            0x41 => match address & !0x1fff {
                0x4100_0000 => Unit::Port,
                0x4100_2000 => Unit::Dsu,
                0x4100_4000 => Unit::Nvmctrl,
                0x4100_6000 => Unit::Dmac,
                0x4100_8000 => Unit::Mtb,
                0x4100_a000 => Unit::Hmatrixhs,
                _ => return None,
            },
            0x48 => match page {
                0x4800_0000 => Unit::Divas,
                _ => return None,
            },
            0x60 => {
                return match address & !0x1ff {
                    0x6000_0000 => Some((Unit::Port, address & 0x1ff)),
                    0x6000_0200 => Some((Unit::Divas, address & 0x1ff)),
                    _ => None,
                };
            }
            _ => return None,
        };
        Some((unit, address - unit.base()))
    }
}

/// Whether `address` lies on the single-cycle I/O bus of the Cortex-M0+ (PORT and DIVAS).
pub const fn on_io_bus(address: u32) -> bool {
    address >> 24 == 0x60
}
