//! One DMA channel and its descriptors (data sheet: "DMAC", "Transfer Descriptors", "Addressing").

use super::Peripherals;
use crate::context::Context;
use crate::nvm::Nvm;
use crate::sram::Sram;
use crate::violation::Kind;
use crate::width::Width;

const A_SWRST: u32 = 1 << 0;
const A_ENABLE: u32 = 1 << 1;
const A_RUNSTDBY: u32 = 1 << 6;

const FLAG_TERR: u32 = 1 << 0;
const FLAG_TCMPL: u32 = 1 << 1;
const FLAG_SUSP: u32 = 1 << 2;

const COMMAND: u32 = 3 << 24;
const EVENTS: u32 = 3 << 3;

const VALID: u16 = 1 << 0;
const STEP_IS_SOURCE: u16 = 1 << 12;
const SOURCE_INCREMENTS: u16 = 1 << 10;
const DESTINATION_INCREMENTS: u16 = 1 << 11;

/// A channel's registers.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(super) struct Channel {
    pub(super) enabled: bool,
    runs_in_standby: bool,
    /// CHCTRLB.
    pub(super) control: u32,
    pub(super) enabled_interrupts: u32,
    pub(super) flags: u32,
    /// A trigger waits.
    pub(super) pending: bool,
    suspended: bool,
    fetch_error: bool,
    /// The first descriptor has been fetched; what is left is in the write-back table.
    started: bool,
}

/// Addresses of a channel's entries in the two tables.
#[derive(Clone, Copy)]
pub(super) struct Tables {
    first: u32,
    write_back: u32,
}

impl Tables {
    pub(super) fn of(base: u32, write_back: u32, channel: usize) -> Tables {
        let entry = 16 * channel as u32;
        Tables { first: base.wrapping_add(entry), write_back: write_back.wrapping_add(entry) }
    }
}

/// A descriptor in memory.
#[derive(Clone, Copy)]
struct Descriptor {
    control: u16,
    count: u16,
    source: u32,
    destination: u32,
    next: u32,
}

impl Descriptor {
    fn read(address: u32, ctx: &mut Context) -> Option<Descriptor> {
        if address & 15 != 0 || !Sram::contains(address) || !Sram::contains(address + 15) {
            ctx.report(Kind::Misuse("DMA descriptor is not 16-byte aligned in SRAM"));
            return None;
        }
        let [control_count, source, destination, next] =
            [0, 4, 8, 12].map(|offset| ctx.sram.read(address + offset, Width::Word));
        let (control, count) = (control_count as u16, (control_count >> 16) as u16);
        Some(Descriptor { control, count, source, destination, next })
    }

    fn write(&self, address: u32, ctx: &mut Context) {
        if !Sram::contains(address) || !Sram::contains(address + 15) {
            return ctx.report(Kind::Misuse("DMA write-back table outside the SRAM"));
        }
        let words = [u32::from(self.control) | u32::from(self.count) << 16, self.source, self.destination, self.next];
        for (index, word) in words.into_iter().enumerate() {
            ctx.sram.write(address + 4 * index as u32, Width::Word, word);
        }
    }

    fn width(&self) -> Option<Width> {
        [Width::Byte, Width::Half, Width::Word].get(usize::from(self.control >> 8 & 3)).copied()
    }

    /// Source and destination of the next beat: addresses name the end of a block that increments.
    fn addresses(&self, width: Width) -> (u32, u32) {
        let step = width.bytes() << (self.control >> 13);
        let (source_step, destination_step) = match self.control & STEP_IS_SOURCE != 0 {
            true => (step, width.bytes()),
            false => (width.bytes(), step),
        };
        let back = |address: u32, increments: u16, step: u32| match self.control & increments != 0 {
            true => address.wrapping_sub(step * u32::from(self.count)),
            false => address,
        };
        (
            back(self.source, SOURCE_INCREMENTS, source_step),
            back(self.destination, DESTINATION_INCREMENTS, destination_step),
        )
    }
}

impl Channel {
    /// The trigger this channel waits for, as a bit.
    pub(super) fn listens(&self) -> u64 {
        match self.control >> 8 & 0x3f {
            0 => 0,
            source if self.enabled => 1 << source,
            _ => 0,
        }
    }

    pub(super) fn is_ready(&self) -> bool {
        self.enabled && self.pending && !self.suspended
    }

    pub(super) fn level(&self) -> u32 {
        self.control >> 5 & 3
    }

    pub(super) fn interrupts(&self) -> bool {
        self.flags & self.enabled_interrupts != 0
    }

    pub(super) fn control_a(&self) -> u32 {
        u32::from(self.enabled) << 1 | u32::from(self.runs_in_standby) << 6
    }

    pub(super) fn status(&self) -> u32 {
        u32::from(self.pending) | u32::from(self.fetch_error) << 2
    }

    /// `levels`: those that CTRL enables.
    pub(super) fn write_control_a(&mut self, value: u32, levels: u32, ctx: &mut Context) {
        if value & A_SWRST != 0 {
            match self.enabled {
                false => *self = Channel::default(),
                true => ctx.report(Kind::Misuse("software reset of a DMA channel that is enabled")),
            }
            return;
        }
        self.runs_in_standby = value & A_RUNSTDBY != 0;
        let enable = value & A_ENABLE != 0;
        if enable && !self.enabled {
            (self.started, self.suspended, self.fetch_error, self.pending) = (false, false, false, false);
            if levels >> self.level() & 1 == 0 {
                ctx.report(Kind::Misuse("DMA channel of a priority level that CTRL does not enable"));
            }
        }
        self.pending &= enable;
        self.enabled = enable;
    }

    pub(super) fn write_control_b(&mut self, value: u32, ctx: &mut Context) {
        let command = value & COMMAND;
        if self.enabled && (value ^ self.control) & !COMMAND != 0 {
            ctx.report(Kind::EnableProtected);
        } else {
            if value & EVENTS != 0 {
                ctx.report(Kind::Unmodelled);
            }
            if value >> 22 & 3 == 1 || value >> 8 & 0x3f > 48 {
                ctx.report(Kind::ReservedValue);
            }
            self.control = value & !COMMAND;
        }
        match command >> 24 {
            0 => {}
            1 => {
                self.suspended = true;
                self.flags |= FLAG_SUSP;
            }
            2 => self.suspended = false,
            _ => ctx.report(Kind::ReservedValue),
        }
    }

    /// Serves a trigger: a beat, a block or all blocks, by TRIGACT. Returns what is left of the block.
    pub(super) fn serve(&mut self, tables: Tables, peripherals: &mut Peripherals, ctx: &mut Context) -> u16 {
        self.pending = false;
        let action = self.control >> 22 & 3;
        loop {
            let from = if self.started { tables.write_back } else { tables.first };
            let Some(mut descriptor) = Descriptor::read(from, ctx) else { return self.stop(FLAG_TERR) };
            if !self.started && !self.is_usable(&descriptor, ctx) {
                return 0;
            }
            self.started = true;
            if !beat(&descriptor, peripherals, ctx) {
                descriptor.write(tables.write_back, ctx);
                return self.stop(FLAG_TERR);
            }
            descriptor.count -= 1;
            let left = descriptor.count;
            descriptor.write(tables.write_back, ctx);
            if left > 0 {
                if action == 2 {
                    return left;
                }
                continue;
            }
            let goes_on = self.end_block(&descriptor, tables, ctx);
            if !goes_on || action != 3 {
                return left;
            }
        }
    }

    fn is_usable(&mut self, descriptor: &Descriptor, ctx: &mut Context) -> bool {
        let valid = descriptor.control & VALID != 0 && descriptor.count != 0 && descriptor.width().is_some();
        if !valid {
            ctx.report(Kind::Misuse("DMA descriptor is not valid"));
            (self.suspended, self.fetch_error) = (true, true);
            self.flags |= FLAG_SUSP;
        }
        valid
    }

    /// A block is done: flags, then the next descriptor. Whether the transaction goes on.
    fn end_block(&mut self, descriptor: &Descriptor, tables: Tables, ctx: &mut Context) -> bool {
        let action = descriptor.control >> 3 & 3;
        if action & 1 != 0 {
            self.flags |= FLAG_TCMPL;
        }
        if action & 2 != 0 {
            self.suspended = true;
            self.flags |= FLAG_SUSP;
        }
        if descriptor.next == 0 {
            self.stop(FLAG_TCMPL);
            return false;
        }
        let Some(next) = Descriptor::read(descriptor.next, ctx) else {
            self.stop(FLAG_TERR);
            return false;
        };
        next.write(tables.write_back, ctx);
        self.is_usable(&next, ctx) && !self.suspended
    }

    fn stop(&mut self, flag: u32) -> u16 {
        self.enabled = false;
        self.pending = false;
        self.flags |= flag;
        0
    }
}

/// Moves one beat. False on a bus error.
fn beat(descriptor: &Descriptor, peripherals: &mut Peripherals, ctx: &mut Context) -> bool {
    let Some(width) = descriptor.width() else { return false };
    let (source, destination) = descriptor.addresses(width);
    let value = match Sram::contains(source) || Nvm::contains(source) {
        true if !width.aligns(source) => None,
        true if Sram::contains(source) => Some(ctx.sram.read(source, width)),
        true => ctx.nvm.read(source, width),
        false => {
            let value = peripherals.read(source, width, ctx);
            (!std::mem::take(&mut ctx.bus_error)).then_some(value)
        }
    };
    let Some(value) = value else {
        ctx.report(Kind::Misuse("DMA source cannot be read"));
        return false;
    };
    if Sram::contains(destination) && width.aligns(destination) {
        ctx.sram.write(destination, width, value);
        return true;
    }
    peripherals.write(destination, width, value, ctx);
    !std::mem::take(&mut ctx.bus_error)
}
