//! DMA channels (data sheet: "DMAC"). Descriptors live in RAM; a channel has one, and links to itself or to nothing.

use core::cell::UnsafeCell;

use arbitrary_int::{u4, u6};

use super::clocks;
use super::regs::dmac::*;

/// Channels with a descriptor.
pub const CHANNELS: usize = 6;

/// A transfer descriptor as the controller reads it.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
pub struct Descriptor {
    /// VALID 0, EVOSEL 1–2, BLOCKACT 3–4, BEATSIZE 8–9, SRCINC 10, DSTINC 11, STEPSEL 12, STEPSIZE 13–15.
    pub control: u16,
    /// Beats in the block.
    pub count: u16,
    /// Address of the source; if it increments, the address **after** the block.
    pub source: u32,
    /// Address of the destination; likewise.
    pub destination: u32,
    /// Next descriptor or 0.
    pub next: u32,
}

/// `control`: the descriptor may be used.
pub const VALID: u16 = 1;
/// `control`: beats of 16 bits; otherwise of 8.
pub const HALF_WORD: u16 = 1 << 8;
/// `control`: the source address increments.
pub const SOURCE_INCREMENTS: u16 = 1 << 10;
/// `control`: the destination address increments.
pub const DESTINATION_INCREMENTS: u16 = 1 << 11;

const EMPTY: Descriptor = Descriptor { control: 0, count: 0, source: 0, destination: 0, next: 0 };

struct Table(UnsafeCell<[Descriptor; CHANNELS]>);
// SAFETY: entries are written by the one owner of a channel while it is off, and by the controller while it is on.
unsafe impl Sync for Table {}

static DESCRIPTORS: Table = Table(UnsafeCell::new([EMPTY; CHANNELS]));
static PROGRESS: Table = Table(UnsafeCell::new([EMPTY; CHANNELS]));

fn dmac() -> MmioDmac<'static> {
    // SAFETY: the controller lies there; the channel registers are touched in critical sections only.
    unsafe { Dmac::new_mmio_at(DMAC) }
}

/// Starts the controller. Call once, before any channel.
pub fn start() {
    clocks::open_ahb(|ahb| ahb.with_dmac(true));
    let mut dmac = dmac();
    dmac.write_ctrl(Ctrl::ZERO.with_swrst(true));
    while dmac.read_ctrl().swrst() {}
    dmac.write_baseaddr(DESCRIPTORS.0.get() as u32);
    dmac.write_wrbaddr(PROGRESS.0.get() as u32);
    let levels = Ctrl::ZERO.with_lvlen0(true).with_lvlen1(true).with_lvlen2(true).with_lvlen3(true);
    dmac.write_ctrl(levels.with_dmaenable(true));
}

/// A beat under way takes some cycles; a channel is asked so often whether it has stopped.
const STOP_POLLS: u32 = 32;

/// One channel. Whoever makes it owns it.
pub struct Channel {
    number: u8,
}

impl Channel {
    /// Channel `number`, below [`CHANNELS`], moving one beat per `trigger`.
    ///
    /// # Safety
    /// Nobody else uses this channel.
    pub unsafe fn new(number: u8, trigger: u6, level: Lvl) -> Option<Channel> {
        if usize::from(number) >= CHANNELS {
            return None;
        }
        let channel = Channel { number };
        channel.with(|dmac| {
            dmac.write_chctrla(ChCtrlA::ZERO.with_swrst(true));
            while dmac.read_chctrla().swrst() {}
            let control = ChCtrlB::ZERO.with_lvl(level).with_trigsrc(trigger).with_trigact(TrigAct::Beat);
            dmac.write_chctrlb(control);
        });
        Some(channel)
    }

    /// The registers with this channel selected.
    fn with<R>(&self, act: impl FnOnce(&mut MmioDmac<'static>) -> R) -> R {
        critical_section::with(|_| {
            let mut dmac = dmac();
            dmac.write_chid(ChId::ZERO.with_id(u4::new(self.number & 15)));
            act(&mut dmac)
        })
    }

    /// The entry of this channel in a table.
    fn entry(&self, table: &'static Table) -> *mut Descriptor {
        // The number is below CHANNELS since `new`.
        table.0.get().cast::<Descriptor>().wrapping_add(self.number.into())
    }

    /// Address of the channel's descriptor: as the `next` of its own transfer it makes a ring.
    pub fn first(&self) -> u32 {
        self.entry(&DESCRIPTORS) as u32
    }

    /// Stops what is under way and starts `transfer`.
    ///
    /// # Safety
    /// The memory it names stays valid, and nobody else writes it, until the channel is stopped or done.
    pub unsafe fn start(&mut self, transfer: Descriptor) {
        self.stop();
        // SAFETY: within the table, and the channel is off, so the controller does not read the entry.
        unsafe { self.entry(&DESCRIPTORS).write_volatile(transfer) };
        // SAFETY: by the contract of this function.
        unsafe { self.restart() };
    }

    /// Stops what is under way and starts the last transfer again.
    ///
    /// # Safety
    /// As for [`Channel::start`].
    pub unsafe fn restart(&mut self) {
        self.with(|dmac| {
            // One that is done has stopped by itself.
            if dmac.read_chctrla().enable() {
                dmac.write_chctrla(ChCtrlA::ZERO);
                // The control tick comes by here: a channel that does not stop must not stop the tick, and is told by
                // scans that never finish.
                let _ = (0..STOP_POLLS).any(|_| !dmac.read_chctrla().enable());
            }
            dmac.write_chintflag(ChInterrupts::ZERO.with_terr(true).with_tcmpl(true).with_susp(true));
            dmac.write_chctrla(ChCtrlA::ZERO.with_enable(true));
        });
    }

    /// Stops; returns when the beat under way is finished.
    pub fn stop(&mut self) {
        self.with(|dmac| {
            dmac.write_chctrla(ChCtrlA::ZERO);
            while dmac.read_chctrla().enable() {}
        });
    }

    /// Whether the block is complete since the start.
    pub fn is_done(&self) -> bool {
        self.with(|dmac| dmac.read_chintflag().tcmpl())
    }

    /// Whether a transfer is under way: started, not stopped, and if it is no ring, not finished.
    pub fn is_busy(&self) -> bool {
        self.with(|dmac| dmac.read_chctrla().enable())
    }

    /// Beats still to move of the present block: from the controller if it is at work for this channel, else what it
    /// last wrote back.
    pub fn left(&self) -> u16 {
        self.with(|dmac| {
            let active = dmac.read_active();
            if active.abusy() && active.id().value() == self.number {
                return active.btcnt();
            }
            // SAFETY: within the table; a 16-bit read of what the controller writes is whole.
            unsafe { (&raw const (*self.entry(&PROGRESS)).count).read_volatile() }
        })
    }
}
