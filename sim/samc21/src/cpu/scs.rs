//! System control space: SysTick, NVIC and SCB registers (ARMv6-M ARM, B3.2 to B3.4; Cortex-M0+ TRM, "System control").

use super::nvic::{NMI, PENDSV, SYSTICK};
use super::{Cpu, nvic};
use crate::context::Context;
use crate::reset::Reset;
use crate::violation::{Access, Kind};
use crate::width::Width;

const SYST_CSR: u32 = 0x010;
const SYST_RVR: u32 = 0x014;
const SYST_CVR: u32 = 0x018;
const SYST_CALIB: u32 = 0x01c;
const ISER: u32 = 0x100;
const ICER: u32 = 0x180;
const ISPR: u32 = 0x200;
const ICPR: u32 = 0x280;
const IPR: u32 = 0x400;
const IPR_LAST: u32 = 0x41c;
const CPUID: u32 = 0xd00;
const ICSR: u32 = 0xd04;
const VTOR: u32 = 0xd08;
const AIRCR: u32 = 0xd0c;
const SCR: u32 = 0xd10;
const CCR: u32 = 0xd14;
const SHPR2: u32 = 0xd1c;
const SHPR3: u32 = 0xd20;
const SHCSR: u32 = 0xd24;
const DHCSR: u32 = 0xdf0;
const DEMCR: u32 = 0xdfc;

/// Cortex-M0+ r0p1.
const CPUID_VALUE: u32 = 0x410c_c601;
/// STKALIGN and UNALIGN_TRP, both fixed.
const CCR_VALUE: u32 = 0x208;
/// NOREF: no reference clock (assumption for this chip).
const CALIB_VALUE: u32 = 1 << 31;
const AIRCR_KEY: u32 = 0x05fa;
const AIRCR_SYSRESETREQ: u32 = 1 << 2;
/// SLEEPONEXIT, SLEEPDEEP, SEVONPEND.
const SCR_BITS: u32 = 1 << 1 | 1 << 2 | 1 << 4;
/// The vector table lies on 128 bytes.
const VTOR_BITS: u32 = !0x7f;

pub(super) const SLEEPONEXIT: u32 = 1 << 1;
pub(super) const SEVONPEND: u32 = 1 << 4;

impl Cpu {
    pub(super) fn read_system(&mut self, access: Access, ctx: &mut Context) -> u32 {
        check_width(access, ctx);
        let offset = access.address & 0xffc;
        match offset {
            SYST_CSR => {
                self.catch_up_systick(ctx);
                self.systick.read_control()
            }
            SYST_RVR => self.systick.reload(),
            SYST_CVR => {
                self.catch_up_systick(ctx);
                self.systick.count(ctx.now)
            }
            SYST_CALIB => CALIB_VALUE,
            ISER | ICER => self.nvic.irqs_enabled(),
            ISPR | ICPR => {
                self.sample_lines(ctx);
                self.nvic.irqs_pending()
            }
            IPR..=IPR_LAST => self.nvic.priorities(nvic::FIRST_IRQ + (offset - IPR)),
            CPUID => CPUID_VALUE,
            ICSR => self.icsr(ctx),
            VTOR => self.vtor,
            AIRCR => 0xfa05_0000,
            SCR => self.scr,
            CCR => CCR_VALUE,
            SHPR2 => self.nvic.priorities(8),
            SHPR3 => self.nvic.priorities(12),
            SHCSR => u32::from(self.nvic.is_pending(nvic::SVCALL)) << 15,
            // No debugger that the firmware could see.
            _ => 0,
        }
    }

    pub(super) fn write_system(&mut self, access: Access, value: u32, ctx: &mut Context) {
        check_width(access, ctx);
        let offset = access.address & 0xffc;
        let ticks = u64::from(ctx.clocks.cpu_ticks);
        match offset {
            SYST_CSR => {
                self.catch_up_systick(ctx);
                self.systick.write_control(value, ctx.now, ticks);
            }
            SYST_RVR => {
                self.catch_up_systick(ctx);
                self.systick.write_reload(value, ctx.now);
            }
            SYST_CVR => {
                self.catch_up_systick(ctx);
                self.systick.clear(ctx.now);
            }
            ISER => self.nvic.enable_irqs(value),
            ICER => self.nvic.disable_irqs(value),
            ISPR => {
                let before = self.nvic.irqs_pending();
                self.nvic.pend_irqs(value);
                self.event |= self.scr & SEVONPEND != 0 && self.nvic.irqs_pending() != before;
            }
            ICPR => self.nvic.unpend_irqs(value),
            IPR..=IPR_LAST => self.nvic.set_priorities(nvic::FIRST_IRQ + (offset - IPR), value),
            ICSR => self.write_icsr(value),
            VTOR => self.vtor = value & VTOR_BITS,
            AIRCR if value >> 16 != AIRCR_KEY => report(Kind::WriteProtected, access, ctx),
            AIRCR if value & AIRCR_SYSRESETREQ != 0 => ctx.request_reset(Reset::System),
            AIRCR => {}
            SCR => self.scr = value & SCR_BITS,
            SHPR2 => self.nvic.set_priorities(8, value & 0xff00_0000),
            SHPR3 => self.nvic.set_priorities(12, value & 0xffff_0000),
            CPUID | SYST_CALIB | CCR => report(Kind::ReadOnly, access, ctx),
            SHCSR | DHCSR..=DEMCR => {}
            _ => report(Kind::NoRegister, access, ctx),
        }
    }

    fn icsr(&mut self, ctx: &mut Context) -> u32 {
        self.sample_lines(ctx);
        let pending = |exception, at: u32| u32::from(self.nvic.is_pending(exception)) << at;
        pending(NMI, 31)
            | pending(PENDSV, 28)
            | pending(SYSTICK, 26)
            | u32::from(self.nvic.irqs_pending() != 0) << 22
            | u32::from(self.nvic.most_urgent().unwrap_or(0)) << 12
            | u32::from(self.ipsr)
    }

    fn write_icsr(&mut self, value: u32) {
        let bit = |at: u32| value >> at & 1 != 0;
        if bit(31) {
            self.nvic.pend(NMI);
        }
        for (exception, set, clear) in [(PENDSV, 28, 27), (SYSTICK, 26, 25)] {
            if bit(set) {
                self.nvic.pend(exception);
            }
            if bit(clear) {
                self.nvic.unpend(exception);
            }
        }
    }
}

fn check_width(access: Access, ctx: &mut Context) {
    if access.width != Width::Word {
        report(Kind::WrongWidth, access, ctx);
    }
}

fn report(kind: Kind, access: Access, ctx: &mut Context) {
    ctx.access = Some(access);
    ctx.report(kind);
    ctx.access = None;
}
