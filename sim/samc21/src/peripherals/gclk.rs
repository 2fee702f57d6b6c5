//! GCLK: generic clocks (data sheet: "GCLK – Generic Clock Controller"). Generators divide sources, channels bring them
//! to peripherals; generator 0 is the CPU's.
//!
//! A generator that is enabled asks for its source whether or not a channel uses it (on silicon only if one does).
//! A generator whose new source does not run yet keeps its old output, as the glitch-free switch does.

use super::Model;
use super::registers::{Map, Register, SyncBusy, crossing, ticks};
use crate::clocks::{CHANNELS, Clocks, GENERATORS, Hertz, Source};
use crate::context::Context;
use crate::reset::Reset;
use crate::time::Cycles;
use crate::violation::Kind;
use crate::width::Width;

const CTRLA: u32 = 0x00;
const SYNCBUSY: u32 = 0x04;
const GENCTRL: u32 = 0x20;
const PCHCTRL: u32 = 0x80;

const MAP: Map = Map(&[
    Register::new(PCHCTRL, Width::Word, 0xcf).times(CHANNELS as u16),
    Register::read_only(SYNCBUSY, Width::Word),
    Register::new(GENCTRL, Width::Word, 0xffff_3f07).times(GENERATORS as u16),
    Register::new(CTRLA, Width::Byte, 1),
]);

const SYNC_SWRST: u32 = 0;
/// SYNCBUSY bit of generator 0.
const SYNC_GENCTRL: u32 = 2;

const GENEN: u32 = 1 << 8;
const DIVSEL: u32 = 1 << 12;
/// High half of DIV, which only generator 1 has.
const LONG_DIV: u32 = 0xff00_0000;

const CHEN: u32 = 1 << 6;
const WRTLOCK: u32 = 1 << 7;
const GEN: u32 = 0xf;

/// GENCTRL0 after reset: OSC48M, enabled (UNVERIFIED; without it the CPU would not run).
const GENCTRL0: u32 = Source::Osc48m as u32 | GENEN;

/// Generators and channels.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Gclk {
    generators: [u32; GENERATORS],
    outputs: [Option<Hertz>; GENERATORS],
    channels: [u32; CHANNELS],
    /// Before this, CHEN reads what it was before the last write.
    settled: [Cycles; CHANNELS],
    sync: SyncBusy,
}

impl Default for Gclk {
    fn default() -> Self {
        let mut gclk = Gclk {
            generators: [0; GENERATORS],
            outputs: [None; GENERATORS],
            channels: [0; CHANNELS],
            settled: [Cycles(0); CHANNELS],
            sync: SyncBusy::default(),
        };
        gclk.generators[0] = GENCTRL0;
        gclk.outputs[0] = Some(Hertz(4_000_000));
        gclk
    }
}

impl Model for Gclk {
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32 {
        MAP.read(offset, width, ctx).map_or(0, |part| {
            part.of(match part.register {
                SYNCBUSY => self.sync.bits(ctx.now),
                GENCTRL => self.generators[part.index],
                PCHCTRL => {
                    let settling = ctx.now < self.settled[part.index];
                    self.channels[part.index] ^ if settling { CHEN } else { 0 }
                }
                _ => self.sync.bits(ctx.now) & 1,
            })
        })
    }

    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context) {
        let Some(part) = MAP.write(offset, width, value, ctx) else { return };
        if self.sync.refuses(1 << SYNC_SWRST, ctx) {
            return;
        }
        match part.register {
            GENCTRL => self.set_generator(part.index, part.onto(self.generators[part.index]), ctx),
            PCHCTRL => self.set_channel(part.index, part.onto(self.channels[part.index]), ctx),
            _ if part.ones() != 0 => {
                self.restart();
                self.sync.start(SYNC_SWRST, crossing(ctx.clocks.source(Source::Osc48m), ctx), ctx.now);
                self.publish(ctx);
            }
            _ => {}
        }
    }

    const NOTICES: bool = true;

    fn notice(&mut self, ctx: &mut Context) {
        self.publish(ctx);
    }

    /// Locked channels outlast every reset but those of the supply.
    fn reset(&mut self, cause: Reset, ctx: &mut Context) {
        if cause.is_of_supply() {
            *self = Gclk::default();
        } else {
            self.restart();
            self.sync = SyncBusy::default();
        }
        self.publish(ctx);
    }
}

impl Gclk {
    /// Everything but what locked channels hold.
    fn restart(&mut self) {
        let old = std::mem::take(self);
        for (index, channel) in old.channels.into_iter().enumerate().filter(|(_, channel)| channel & WRTLOCK != 0) {
            self.channels[index] = channel;
            let generator = (channel & GEN) as usize;
            self.generators[generator] = old.generators[generator];
        }
    }

    fn is_locked(&self, generator: usize) -> bool {
        self.channels.iter().any(|channel| channel & WRTLOCK != 0 && (channel & GEN) as usize == generator)
    }

    fn set_generator(&mut self, index: usize, new: u32, ctx: &mut Context) {
        let busy = SYNC_GENCTRL + index as u32;
        if self.sync.refuses(1 << busy, ctx) {
            return;
        }
        if self.is_locked(index) {
            ctx.report(Kind::WriteProtected);
            return;
        }
        let mut new = new;
        if index != 1 && new & LONG_DIV != 0 {
            ctx.report(Kind::ReservedBits(new & LONG_DIV));
            new &= !LONG_DIV;
        }
        if index == 0 && new & GENEN == 0 {
            ctx.report(Kind::Misuse("generator 0 clocks the CPU and cannot be disabled"));
            new |= GENEN;
        }
        let source = new & 7;
        if index == 1 && source == Source::Generator1 as u32 {
            ctx.report(Kind::ReservedValue);
        }
        if index == 0 && ctx.clocks.sources[source as usize].is_none() && source != Source::Generator1 as u32 {
            ctx.report(Kind::Misuse("the CPU is given a clock source that does not run"));
        }
        self.generators[index] = new;
        self.publish(ctx);
        // A generator that is off synchronises with nothing.
        let ticks = if new & GENEN == 0 { 0 } else { crossing(self.outputs[index], ctx) };
        self.sync.start(busy, ticks, ctx.now);
    }

    fn set_channel(&mut self, index: usize, new: u32, ctx: &mut Context) {
        let old = self.channels[index];
        if old & WRTLOCK != 0 {
            ctx.report(Kind::WriteProtected);
            return;
        }
        if (new & GEN) as usize >= GENERATORS {
            ctx.report(Kind::ReservedValue);
            return;
        }
        if old & new & CHEN != 0 && (old ^ new) & GEN != 0 {
            ctx.report(Kind::Misuse("a channel must be off while its generator is chosen"));
        }
        self.channels[index] = new;
        if (old ^ new) & CHEN != 0 {
            let output = self.outputs[(new & GEN) as usize];
            if output.is_none() {
                ctx.report(Kind::Misuse("a channel is fed by a generator that does not run"));
            }
            self.settled[index] = Cycles(ctx.now.0.saturating_add(ticks(3, output)));
        }
        self.publish(ctx);
    }

    /// Recomputes every clock from the sources.
    fn publish(&mut self, ctx: &mut Context) {
        let mut clocks = ctx.clocks.clone();
        clocks.wanted_by_generators = 0;
        // Generator 1 first: it may be the source of others.
        for index in (0..GENERATORS).map(|n| [1, 0, 2, 3, 4, 5, 6, 7, 8][n]) {
            let control = self.generators[index];
            if control & GENEN == 0 {
                self.outputs[index] = None;
                continue;
            }
            clocks.wanted_by_generators |= 1 << (control & 7);
            let source = match control & 7 {
                2 => self.outputs[1],
                source => clocks.sources[source as usize],
            };
            if let Some(Hertz(hertz)) = source {
                self.outputs[index] = Some(Hertz(hertz / divider(control)));
            }
        }
        for (index, generic) in clocks.generic.iter_mut().enumerate() {
            let channel = self.channels[index];
            *generic = if channel & CHEN == 0 { None } else { self.outputs[(channel & GEN) as usize] };
        }
        clocks.main = self.outputs[0].unwrap_or(clocks.main);
        if clocks.main != ctx.clocks.main {
            clocks.set_cpu_ticks();
        }
        if clocks != ctx.clocks {
            self.check_cpu(&clocks, ctx);
            ctx.clocks = clocks;
            ctx.wires.changed = true;
        }
    }

    fn check_cpu(&self, clocks: &Clocks, ctx: &mut Context) {
        if clocks.cpu() != ctx.clocks.cpu() && clocks.cpu().0 > Cycles::HZ as u32 {
            ctx.report(Kind::Misuse("the CPU is clocked above 48 MHz"));
        }
    }
}

/// What a generator divides by (GENCTRL.DIV and DIVSEL).
const fn divider(control: u32) -> u32 {
    let div = control >> 16;
    if control & DIVSEL != 0 {
        // Beyond the largest exponent of generator 1 the field makes no sense; the others stop at 2⁸.
        1 << if div < 16 { div + 1 } else { 17 }
    } else if div == 0 {
        1
    } else {
        div
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gclk() -> (Gclk, Context) {
        let (mut gclk, mut ctx) = (Gclk::default(), Context::default());
        gclk.reset(Reset::PowerOn, &mut ctx);
        ctx.clocks.sources[Source::Dpll96m as usize] = Some(Hertz(96_000_000));
        (gclk, ctx)
    }

    fn generator(index: u32) -> u32 {
        GENCTRL + 4 * index
    }

    fn channel(number: u32) -> u32 {
        PCHCTRL + 4 * number
    }

    #[test]
    fn after_reset_the_cpu_runs_at_4_mhz_and_no_channel_at_all() {
        let (_, ctx) = gclk();
        assert_eq!((ctx.clocks.cpu(), ctx.clocks.cpu_ticks), (Hertz(4_000_000), 12));
        assert_eq!(ctx.clocks.generic, [None; CHANNELS]);
    }

    #[test]
    fn generator_0_clocks_the_cpu() {
        let (mut gclk, mut ctx) = gclk();
        gclk.write(generator(0), Width::Word, 7 | GENEN | 2 << 16, &mut ctx);
        assert_eq!((ctx.clocks.cpu(), ctx.clocks.cpu_ticks), (Hertz(48_000_000), 1));
        assert_eq!(gclk.read(SYNCBUSY, Width::Word, &mut ctx), 1 << SYNC_GENCTRL);
        ctx.now += 9;
        assert_eq!(gclk.read(SYNCBUSY, Width::Word, &mut ctx), 0);
        assert_eq!(ctx.violations(), []);
    }

    #[test]
    fn a_channel_reads_enabled_once_its_clock_has_come() {
        let (mut gclk, mut ctx) = gclk();
        gclk.write(generator(1), Width::Word, 7 | GENEN | 6 << 16, &mut ctx);
        gclk.write(channel(30), Width::Word, 1 | CHEN, &mut ctx);
        assert_eq!(ctx.clocks.generic[30], Some(Hertz(16_000_000)));
        assert_eq!(gclk.read(channel(30), Width::Word, &mut ctx), 1);
        ctx.now += 9;
        assert_eq!(gclk.read(channel(30), Width::Word, &mut ctx), 1 | CHEN);
        assert_eq!(ctx.violations(), []);
    }

    #[test]
    fn a_channel_on_a_stopped_generator_is_reported_and_never_reads_enabled() {
        let (mut gclk, mut ctx) = gclk();
        gclk.write(channel(30), Width::Word, 3 | CHEN, &mut ctx);
        assert!(matches!(ctx.violations()[0].kind, Kind::Misuse(_)));
        ctx.now += 1 << 40;
        assert_eq!(gclk.read(channel(30), Width::Word, &mut ctx), 3);
    }

    #[test]
    fn a_generator_is_not_written_while_it_synchronises() {
        let (mut gclk, mut ctx) = gclk();
        gclk.write(generator(0), Width::Word, 6 | GENEN, &mut ctx);
        gclk.write(generator(0), Width::Word, 7 | GENEN | 2 << 16, &mut ctx);
        assert_eq!((ctx.violations()[0].kind, ctx.clocks.cpu()), (Kind::SyncBusy, Hertz(4_000_000)));
    }

    #[test]
    fn only_generator_1_has_a_long_divider() {
        let (mut gclk, mut ctx) = gclk();
        gclk.write(generator(1), Width::Word, 7 | GENEN | 960 << 16, &mut ctx);
        assert_eq!(gclk.outputs[1], Some(Hertz(100_000)));
        gclk.write(generator(2), Width::Word, 7 | GENEN | 960 << 16, &mut ctx);
        assert_eq!(ctx.violations()[0].kind, Kind::ReservedBits(0x300 << 16));
    }

    #[test]
    fn a_cpu_beyond_48_mhz_is_reported() {
        let (mut gclk, mut ctx) = gclk();
        gclk.write(generator(0), Width::Word, 7 | GENEN, &mut ctx);
        assert!(matches!(ctx.violations()[0].kind, Kind::Misuse(_)));
    }

    #[test]
    fn a_locked_channel_and_its_generator_stay_until_the_supply_goes() {
        let (mut gclk, mut ctx) = gclk();
        gclk.write(generator(1), Width::Word, 6 | GENEN, &mut ctx);
        gclk.write(channel(2), Width::Word, 1 | CHEN | WRTLOCK, &mut ctx);
        gclk.write(channel(2), Width::Word, 0, &mut ctx);
        ctx.now += 1000;
        gclk.write(generator(1), Width::Word, 0, &mut ctx);
        assert!(ctx.violations().iter().all(|violation| violation.kind == Kind::WriteProtected));
        assert_eq!(ctx.violation_count(), 2);
        gclk.reset(Reset::System, &mut ctx);
        assert_eq!(ctx.clocks.generic[2], Some(Hertz(4_000_000)));
        gclk.reset(Reset::PowerOn, &mut ctx);
        assert_eq!(ctx.clocks.generic[2], None);
    }
}
