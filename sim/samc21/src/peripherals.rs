//! The peripherals of a chip behind their bus bridges: address decoding, clock gating, and the calendar of what each
//! model does next.
//!
//! A model is a plain struct with its registers, one field of [`Peripherals`] and one arm of `with_model!`. No model
//! knows another: they meet in [`Context`].

pub mod adc;
mod calendar;
pub mod can;
mod counter;
pub mod divas;
pub mod dmac;
pub mod dsu;
pub mod eic;
pub mod gclk;
pub mod mclk;
mod model;
pub mod nvmctrl;
pub mod osc32kctrl;
pub mod oscctrl;
pub mod pm;
pub mod port;
mod registers;
pub mod rstc;
pub mod sercom;
mod signals;
pub mod supc;
pub mod tc;
pub mod tcc;
pub mod wdt;

use crate::context::Context;
use crate::reset::Reset;
use crate::time::Cycles;
use crate::unit::{Unit, on_io_bus};
use crate::violation::{Access, Kind};
use crate::width::Width;

pub use model::Model;

use adc::Adc;
use calendar::Calendar;
use can::Can;
use divas::Divas;
use dmac::Dmac;
use dsu::Dsu;
use eic::Eic;
use gclk::Gclk;
use mclk::Mclk;
use model::notices;
use nvmctrl::Nvmctrl;
use osc32kctrl::Osc32kctrl;
use oscctrl::Oscctrl;
use pm::Pm;
use port::Port;
use rstc::Rstc;
use sercom::Sercom;
use supc::Supc;
use tc::Tc;
use tcc::Tcc;
use wdt::Wdt;

/// CPU cycles that an access through an AHB-APB bridge takes beyond the load's or store's own two.
///
/// Assumption: the data sheet gives no figure. An APB transfer has a setup and an access cycle, and the bridge registers
/// the address.
pub const APB_WAIT: u32 = 2;

/// All peripheral models of a chip.
#[derive(Clone, Debug)]
pub struct Peripherals {
    /// CAN0 and CAN1.
    pub can: [Can; 2],
    /// ADC0 and ADC1.
    pub adc: [Adc; 2],
    /// DMAC.
    pub dmac: Dmac,
    /// SERCOM0 to SERCOM5.
    pub sercom: [Sercom; 6],
    /// RSTC.
    pub rstc: Rstc,
    /// DSU.
    pub dsu: Dsu,
    /// PM.
    pub pm: Pm,
    /// SUPC.
    pub supc: Supc,
    /// MCLK.
    pub mclk: Mclk,
    /// GCLK.
    pub gclk: Gclk,
    /// OSC32KCTRL.
    pub osc32kctrl: Osc32kctrl,
    /// OSCCTRL.
    pub oscctrl: Oscctrl,
    /// WDT.
    pub wdt: Wdt,
    /// NVMCTRL.
    pub nvmctrl: Nvmctrl,
    /// PORT.
    pub port: Port,
    /// TC0 to TC4.
    pub tc: [Tc; 5],
    /// TCC0 to TCC2.
    pub tcc: [Tcc; 3],
    /// EIC.
    pub eic: Eic,
    /// Divide and square root accelerator.
    pub divas: Divas,
    calendar: Calendar,
}

/// Evaluates `$body` with `$model` bound to the model of `$unit`, or `$absent` if the unit is not modelled.
macro_rules! with_model {
    ($self:ident, $unit:expr, $model:ident => $body:expr, else $absent:expr) => {
        with_model!(of $unit, $model => $body, else $absent;
            Can0: $self.can[0],
            Can1: $self.can[1],
            Adc0: $self.adc[0],
            Adc1: $self.adc[1],
            Dmac: $self.dmac,
            Sercom0: $self.sercom[0],
            Sercom1: $self.sercom[1],
            Sercom2: $self.sercom[2],
            Sercom3: $self.sercom[3],
            Sercom4: $self.sercom[4],
            Sercom5: $self.sercom[5],
            Rstc: $self.rstc,
            Dsu: $self.dsu,
            Pm: $self.pm,
            Supc: $self.supc,
            Mclk: $self.mclk,
            Gclk: $self.gclk,
            Osc32kctrl: $self.osc32kctrl,
            Oscctrl: $self.oscctrl,
            Wdt: $self.wdt,
            Nvmctrl: $self.nvmctrl,
            Port: $self.port,
            Tc0: $self.tc[0],
            Tc1: $self.tc[1],
            Tc2: $self.tc[2],
            Tc3: $self.tc[3],
            Tc4: $self.tc[4],
            Tcc0: $self.tcc[0],
            Tcc1: $self.tcc[1],
            Tcc2: $self.tcc[2],
            Eic: $self.eic,
            Divas: $self.divas,
        )
    };
    (of $unit:expr, $model:ident => $body:expr, else $absent:expr; $($name:ident: $place:expr,)*) => {
        match $unit {
            $(Unit::$name => {
                let $model = &mut $place;
                $body
            })*
            _ => $absent,
        }
    };
}

impl Default for Peripherals {
    fn default() -> Self {
        Peripherals {
            can: [Can::new(0), Can::new(1)],
            adc: [Adc::new(0), Adc::new(1)],
            dmac: Dmac::default(),
            sercom: std::array::from_fn(Sercom::new),
            rstc: Rstc::default(),
            dsu: Dsu,
            pm: Pm::default(),
            supc: Supc::default(),
            mclk: Mclk::default(),
            gclk: Gclk::default(),
            osc32kctrl: Osc32kctrl::default(),
            oscctrl: Oscctrl::default(),
            wdt: Wdt::default(),
            nvmctrl: Nvmctrl::default(),
            port: Port::default(),
            tc: std::array::from_fn(Tc::new),
            tcc: std::array::from_fn(Tcc::new),
            eic: Eic::default(),
            divas: Divas::default(),
            calendar: Calendar::default(),
        }
    }
}

impl Peripherals {
    /// Reads through the bus. Anything wrong is reported; what faults also sets the context's bus error.
    pub fn read(&mut self, address: u32, width: Width, ctx: &mut Context) -> u32 {
        ctx.access = Some(Access { address, width, written: None });
        let value = match self.decode(address, width, ctx) {
            Some((unit, offset)) => {
                let value = with_model!(self, unit, model => {
                    let value = model.read(offset, width, ctx);
                    let due = model.next_event();
                    self.schedule(unit, due, ctx);
                    value
                }, else unmodelled(ctx));
                value & width.mask()
            }
            None => 0,
        };
        self.finish(ctx);
        self.serve_dma(ctx);
        value
    }

    /// Writes through the bus. Anything wrong is reported; what faults also sets the context's bus error.
    pub fn write(&mut self, address: u32, width: Width, value: u32, ctx: &mut Context) {
        let value = value & width.mask();
        ctx.access = Some(Access { address, width, written: Some(value) });
        if let Some((unit, offset)) = self.decode(address, width, ctx) {
            with_model!(self, unit, model => {
                model.write(offset, width, value, ctx);
                let due = model.next_event();
                self.schedule(unit, due, ctx);
            }, else {
                unmodelled(ctx);
            });
            if unit == Unit::Port {
                ctx.wires.follow_selects(ctx.now);
            }
        }
        self.finish(ctx);
        self.serve_dma(ctx);
    }

    /// When the first model acts by itself.
    pub fn next_event(&self) -> Cycles {
        self.calendar.next()
    }

    /// A CPU store into non-volatile memory, which fills NVMCTRL's page buffer.
    pub fn store_nvm(&mut self, address: u32, width: Width, value: u32, ctx: &mut Context) {
        ctx.access = Some(Access { address, width, written: Some(value & width.mask()) });
        ctx.unit = Some(Unit::Nvmctrl);
        self.nvmctrl.store(address, width, value, ctx);
        let due = self.nvmctrl.next_event();
        self.schedule(Unit::Nvmctrl, due, ctx);
        self.finish(ctx);
    }

    /// Lets every model act whose time has come.
    pub fn advance(&mut self, ctx: &mut Context) {
        for unit in Unit::ALL {
            if self.calendar.due(unit) <= ctx.now {
                ctx.unit = Some(unit);
                with_model!(self, unit, model => {
                    model.advance(ctx);
                    let due = model.next_event();
                    self.schedule(unit, due, ctx);
                    // A model that stays due would stop the clock.
                    debug_assert!(self.calendar.due(unit) > ctx.now, "{} stays due", unit.name());
                }, else ());
            }
        }
        ctx.unit = None;
        self.serve_dma(ctx);
    }

    /// Lets the DMA controller move what is asked for, between two accesses of the CPU and without holding it up.
    #[inline]
    fn serve_dma(&mut self, ctx: &mut Context) {
        if self.dmac.has_work(ctx) {
            self.run_dma(ctx);
        }
    }

    #[inline(never)]
    fn run_dma(&mut self, ctx: &mut Context) {
        let (now, bus_error) = (ctx.now, std::mem::take(&mut ctx.bus_error));
        let mut dmac = std::mem::take(&mut self.dmac);
        dmac.run(self, ctx);
        self.dmac = dmac;
        (ctx.now, ctx.bus_error) = (now, bus_error);
    }

    /// Tells every model that wires or clocks have changed.
    pub fn notice(&mut self, ctx: &mut Context) {
        for unit in Unit::ALL {
            with_model!(self, unit, model => {
                if notices(model) {
                    ctx.unit = Some(unit);
                    model.notice(ctx);
                    let due = model.next_event();
                    self.schedule(unit, due, ctx);
                }
            }, else ());
        }
        ctx.unit = None;
    }

    /// Resets every model.
    pub fn reset(&mut self, cause: Reset, ctx: &mut Context) {
        for unit in Unit::ALL {
            with_model!(self, unit, model => {
                model.reset(cause, ctx);
                let due = model.next_event();
                self.schedule(unit, due, ctx);
            }, else ());
        }
    }

    /// The unit that answers, after the checks every access has in common.
    #[inline]
    fn decode(&self, address: u32, width: Width, ctx: &mut Context) -> Option<(Unit, u32)> {
        ctx.unit = None;
        if !width.aligns(address) {
            ctx.report(Kind::Unaligned);
            ctx.fail_access();
            return None;
        }
        let Some((unit, offset)) = Unit::at(address) else {
            ctx.report(Kind::Unmapped);
            ctx.fail_access();
            return None;
        };
        ctx.unit = Some(unit);
        if address >> 24 < 0x48 {
            ctx.stall(u64::from(APB_WAIT * ctx.clocks.cpu_ticks));
        }
        if !ctx.clocks.bus_runs(unit) && !on_io_bus(address) {
            ctx.report(Kind::Unclocked);
            return None;
        }
        Some((unit, offset))
    }

    /// Enters a model's next event into the calendar, and has the CPU look at the calendar again if it is now the first.
    #[inline]
    fn schedule(&mut self, unit: Unit, due: Option<Cycles>, ctx: &mut Context) {
        ctx.attention |= self.calendar.enter(unit, due);
    }

    fn finish(&mut self, ctx: &mut Context) {
        ctx.unit = None;
        ctx.access = None;
    }
}

/// No model: nothing that the firmware would do with a made-up answer is worth emulating.
#[cold]
fn unmodelled(ctx: &mut Context) -> u32 {
    ctx.report(Kind::Unmodelled);
    ctx.fail_access();
    0
}
