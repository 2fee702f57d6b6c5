//! The peripherals of a chip behind their bus bridges: address decoding, clock gating, and the calendar of what each
//! model does next.
//!
//! A model is a plain struct with its registers, one field of [`Peripherals`] and one arm of `with_model!`. No model
//! knows another: they meet in [`Context`].

pub mod adc;
pub mod can;
mod counter;
pub mod divas;
pub mod dmac;
pub mod dsu;
pub mod eic;
pub mod gclk;
pub mod mclk;
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

use adc::Adc;
use can::Can;
use divas::Divas;
use dmac::Dmac;
use dsu::Dsu;
use eic::Eic;
use gclk::Gclk;
use mclk::Mclk;
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

/// The behaviour of one peripheral.
///
/// `offset` is relative to the unit's base. Time passes only through [`Context::now`]; a model that acts later says so
/// in [`Model::next_event`] and is then called by [`Model::advance`].
pub trait Model {
    /// A read of `width` at `offset`, aligned to `width`. Unused high bits of the result are ignored.
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32;

    /// A write of `width` at `offset`, aligned to `width`. `value` has no bits beyond `width`.
    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context);

    /// When the model next acts by itself; asked after every other call. In the past means at once.
    fn next_event(&self) -> Option<Cycles> {
        None
    }

    /// [`Model::next_event`] has come: `ctx.now` is at or after it. Must move its next event into the future.
    fn advance(&mut self, _ctx: &mut Context) {}

    /// Whether [`Model::notice`] does anything.
    const NOTICES: bool = false;

    /// The outside has changed [`Context::wires`], or a clock model has changed [`Context::clocks`].
    fn notice(&mut self, _ctx: &mut Context) {}

    /// Any reset of the chip but a power-on: by default everything starts over. `self` is then as constructed.
    fn reset(&mut self, _cause: Reset, _ctx: &mut Context)
    where
        Self: Default,
    {
        *self = Self::default();
    }
}

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
    /// When each unit's model acts next, by unit number.
    due: [Cycles; Unit::COUNT],
    /// The earliest of `due`.
    next: Cycles,
}

/// Evaluates `$body` with `$model` bound to the model of `$unit`, or `$absent` if the unit is not modelled.
macro_rules! with_model {
    ($self:ident, $unit:expr, $model:ident => $body:expr, else $absent:expr) => {
        match $unit {
            Unit::Can0 => {
                let $model = &mut $self.can[0];
                $body
            }
            Unit::Can1 => {
                let $model = &mut $self.can[1];
                $body
            }
            Unit::Adc0 => {
                let $model = &mut $self.adc[0];
                $body
            }
            Unit::Adc1 => {
                let $model = &mut $self.adc[1];
                $body
            }
            Unit::Dmac => {
                let $model = &mut $self.dmac;
                $body
            }
            Unit::Sercom0 => {
                let $model = &mut $self.sercom[0];
                $body
            }
            Unit::Sercom1 => {
                let $model = &mut $self.sercom[1];
                $body
            }
            Unit::Sercom2 => {
                let $model = &mut $self.sercom[2];
                $body
            }
            Unit::Sercom3 => {
                let $model = &mut $self.sercom[3];
                $body
            }
            Unit::Sercom4 => {
                let $model = &mut $self.sercom[4];
                $body
            }
            Unit::Sercom5 => {
                let $model = &mut $self.sercom[5];
                $body
            }
            Unit::Rstc => {
                let $model = &mut $self.rstc;
                $body
            }
            Unit::Dsu => {
                let $model = &mut $self.dsu;
                $body
            }
            Unit::Pm => {
                let $model = &mut $self.pm;
                $body
            }
            Unit::Supc => {
                let $model = &mut $self.supc;
                $body
            }
            Unit::Mclk => {
                let $model = &mut $self.mclk;
                $body
            }
            Unit::Gclk => {
                let $model = &mut $self.gclk;
                $body
            }
            Unit::Osc32kctrl => {
                let $model = &mut $self.osc32kctrl;
                $body
            }
            Unit::Oscctrl => {
                let $model = &mut $self.oscctrl;
                $body
            }
            Unit::Wdt => {
                let $model = &mut $self.wdt;
                $body
            }
            Unit::Nvmctrl => {
                let $model = &mut $self.nvmctrl;
                $body
            }
            Unit::Port => {
                let $model = &mut $self.port;
                $body
            }
            Unit::Tc0 => {
                let $model = &mut $self.tc[0];
                $body
            }
            Unit::Tc1 => {
                let $model = &mut $self.tc[1];
                $body
            }
            Unit::Tc2 => {
                let $model = &mut $self.tc[2];
                $body
            }
            Unit::Tc3 => {
                let $model = &mut $self.tc[3];
                $body
            }
            Unit::Tc4 => {
                let $model = &mut $self.tc[4];
                $body
            }
            Unit::Tcc0 => {
                let $model = &mut $self.tcc[0];
                $body
            }
            Unit::Tcc1 => {
                let $model = &mut $self.tcc[1];
                $body
            }
            Unit::Tcc2 => {
                let $model = &mut $self.tcc[2];
                $body
            }
            Unit::Eic => {
                let $model = &mut $self.eic;
                $body
            }
            Unit::Divas => {
                let $model = &mut $self.divas;
                $body
            }
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
            due: [Cycles::NEVER; Unit::COUNT],
            next: Cycles::NEVER,
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
        self.next
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
            if self.due[unit as usize] <= ctx.now {
                ctx.unit = Some(unit);
                with_model!(self, unit, model => {
                    model.advance(ctx);
                    let due = model.next_event();
                    self.schedule(unit, due, ctx);
                    // A model that stays due would stop the clock.
                    debug_assert!(self.due[unit as usize] > ctx.now, "{} stays due", unit.name());
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
        let due = due.unwrap_or(Cycles::NEVER);
        let before = std::mem::replace(&mut self.due[unit as usize], due);
        if due < self.next {
            self.next = due;
            ctx.attention = true;
        } else if before == self.next && due != before {
            self.next = self.due.iter().copied().min().unwrap_or(Cycles::NEVER);
        }
    }

    fn finish(&mut self, ctx: &mut Context) {
        ctx.unit = None;
        ctx.access = None;
    }
}

/// Whether a model wants to know that wires or clocks have changed.
const fn notices<M: Model>(_: &M) -> bool {
    M::NOTICES
}

/// No model: nothing that the firmware would do with a made-up answer is worth emulating.
#[cold]
fn unmodelled(ctx: &mut Context) -> u32 {
    ctx.report(Kind::Unmodelled);
    ctx.fail_access();
    0
}
