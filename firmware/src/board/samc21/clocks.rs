//! From 4 MHz after reset to 48 MHz exact (data sheet: "Clock System", "OSCCTRL", "OSC32KCTRL", "GCLK").
//!
//! ```text
//!  XOSC32K 32.768 kHz ─► DPLL × 2929 11/16 = 96 MHz ─┬─► ÷2  generator 0: 48 MHz  CPU, CAN, TCC, SERCOM, ADC, tick
//!                                                    └─► ÷6  generator 1: 16 MHz  time base
//!  OSC48M ──────────── instead, if the crystal fails ┬─► ÷1  generator 0
//!                                                    └─► ÷3  generator 1
//! ```
//!
//! The board has no fast crystal, only the one for a watch; its multiple is exact and CAN-FD needs that: OSC48M may be
//! off by more than a bit rate of 2 Mbit/s forgives. With OSC48M everything but the bus works, and the boot report says
//! so. Jitter of the DPLL from a 32 kHz reference: UNVERIFIED on silicon.

#[cfg(target_os = "none")]
use crate::board::boot::ClockSource;

/// CPU and fast peripherals, Hz.
pub const CPU_HZ: u32 = 48_000_000;
/// Time base, Hz.
pub const TIME_BASE_HZ: u32 = 16_000_000;
/// The crystal, Hz.
pub const CRYSTAL_HZ: u32 = 32_768;
/// DPLL ratio: LDR and LDRFRAC; the factor is LDR + 1 + LDRFRAC / 16.
pub const DPLL_RATIO: (u16, u8) = (2928, 11);

const _: () = {
    let dpll_16 = CRYSTAL_HZ as u64 * ((DPLL_RATIO.0 as u64 + 1) * 16 + DPLL_RATIO.1 as u64);
    assert!(dpll_16 == 16 * 2 * CPU_HZ as u64);
};

/// Peripheral clock channels.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
#[allow(missing_docs)]
pub enum Channel {
    Eic = 2,
    Sercom1Core = 20,
    Sercom4Core = 23,
    Can0 = 26,
    /// With TCC1.
    Tcc0 = 28,
    /// With TC1.
    Tc0 = 30,
    Tc4 = 32,
    Adc0 = 33,
}

/// Clock generators in use.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Generator {
    /// [`CPU_HZ`].
    Cpu = 0,
    /// [`TIME_BASE_HZ`].
    TimeBase = 1,
}

#[cfg(target_os = "none")]
mod driver {
    use super::super::regs::clock::*;
    use super::super::regs::nvmctrl::{self, Nvmctrl};
    use super::{CPU_HZ, Channel, ClockSource, DPLL_RATIO, Generator};
    use arbitrary_int::{u4, u12};
    use cortex_m::asm;

    // SAFETY (all four): the blocks lie there; they are written while setting up only, from one thread.
    fn gclk() -> MmioGclk<'static> {
        // SAFETY: see above.
        unsafe { Gclk::new_mmio_at(GCLK) }
    }
    fn mclk() -> MmioMclk<'static> {
        // SAFETY: see above.
        unsafe { Mclk::new_mmio_at(MCLK) }
    }
    fn oscctrl() -> MmioOscctrl<'static> {
        // SAFETY: see above.
        unsafe { Oscctrl::new_mmio_at(OSCCTRL) }
    }
    fn osc32kctrl() -> MmioOsc32kctrl<'static> {
        // SAFETY: see above.
        unsafe { Osc32kctrl::new_mmio_at(OSC32KCTRL) }
    }

    /// Brings the chip to 48 MHz. Takes up to a second while the crystal starts.
    pub fn start() -> ClockSource {
        // Before the clock rises: at 48 MHz the flash needs two wait states.
        // SAFETY: the block lies there and nobody else uses it yet.
        let mut nvm = unsafe { Nvmctrl::new_mmio_at(nvmctrl::NVMCTRL) };
        nvm.modify_ctrlb(|ctrlb| ctrlb.with_rws(u4::new(2)));

        let mut osc = oscctrl();
        osc.write_osc48mdiv(Osc48mDiv::ZERO);
        while osc.read_osc48msyncbusy().osc48mdiv() {}

        let (source, dividers) = match crystal_started() && dpll_locked() {
            true => (ClockSource::Crystal, [(Source::Dpll96m, 2), (Source::Dpll96m, 6)]),
            false => (ClockSource::Internal, [(Source::Osc48m, 1), (Source::Osc48m, 3)]),
        };
        let mut gclk = gclk();
        for (generator, (source, divider)) in dividers.into_iter().enumerate() {
            let control = GenCtrl::ZERO.with_src(source).with_genen(true).with_div(divider);
            let _ = gclk.write_genctrl(generator, control);
            while gclk.read_syncbusy().raw_value() != 0 {}
        }
        source
    }

    /// Polls at 48 MHz until `done`, at most `ms`.
    fn within(ms: u32, done: impl Fn() -> bool) -> bool {
        for _ in 0..ms {
            if done() {
                return true;
            }
            asm::delay(CPU_HZ / 1000);
        }
        false
    }

    fn crystal_started() -> bool {
        let mut osc = osc32kctrl();
        // A reset that is not a power-up may leave it running.
        if !osc.read_status().xosc32krdy() {
            let control = Xosc32k::ZERO.with_xtalen(true).with_en32k(true).with_startup(Startup::Cycle16384);
            osc.write_xosc32k(control);
            osc.write_xosc32k(control.with_enable(true));
        }
        // 16384 cycles are half a second.
        within(1_500, || osc32kctrl().read_status().xosc32krdy())
    }

    fn dpll_locked() -> bool {
        let mut osc = oscctrl();
        osc.write_dpllctrla(DpllCtrlA::ZERO);
        while osc.read_dpllsyncbusy().enable() {}
        let (ldr, ldrfrac) = DPLL_RATIO;
        osc.write_dpllratio(DpllRatio::ZERO.with_ldr(u12::new(ldr)).with_ldrfrac(u4::new(ldrfrac)));
        while osc.read_dpllsyncbusy().dpllratio() {}
        // The lock is judged below; afterwards a lock detector that blinks must not stop the CPU's clock.
        osc.write_dpllctrlb(DpllCtrlB::ZERO.with_refclk(RefClk::Xosc32k).with_lbypass(true));
        osc.write_dpllctrla(DpllCtrlA::ZERO.with_enable(true));
        while osc.read_dpllsyncbusy().enable() {}
        within(100, || {
            let status = oscctrl().read_dpllstatus();
            status.lock() && status.clkrdy()
        })
    }

    /// Gives a peripheral its clock.
    pub fn feed(channel: Channel, generator: Generator) {
        let mut gclk = gclk();
        let control = PchCtrl::ZERO.with_gen_(u4::new(generator as u8)).with_chen(true);
        let _ = gclk.write_pchctrl(channel as usize, control);
        while !gclk.read_pchctrl(channel as usize).is_ok_and(|now| now.chen()) {}
    }

    /// Lets the bus reach peripherals on APB bridge C.
    pub fn open_apb(add: impl FnOnce(ApbCMask) -> ApbCMask) {
        mclk().modify_apbcmask(add);
    }

    /// Lets the bus reach peripherals on AHB.
    pub fn open_ahb(add: impl FnOnce(AhbMask) -> AhbMask) {
        mclk().modify_ahbmask(add);
    }
}

#[cfg(target_os = "none")]
pub use driver::{feed, open_ahb, open_apb, start};

#[cfg(test)]
#[test]
fn every_channel_is_the_facts() {
    use super::regs::facts;
    let ours = [
        ("EIC", Channel::Eic),
        ("SERCOM1_CORE", Channel::Sercom1Core),
        ("SERCOM4_CORE", Channel::Sercom4Core),
        ("CAN0", Channel::Can0),
        ("TCC0", Channel::Tcc0),
        ("TC0", Channel::Tc0),
        ("TC1", Channel::Tc0),
        ("TC4", Channel::Tc4),
        ("ADC0", Channel::Adc0),
    ];
    for (name, channel) in ours {
        assert_eq!(facts::number("channels", name), i64::from(channel as u8), "{name}");
    }
}
