//! The coordinator's tasks: what runs at which priority, and what passes between. The same on every board.
//!
//! ```text
//!  timer, 1 kHz ► control task (interrupt executor)             thread executor
//!                 IMU ► on_imu ► motion leaves at once           bus          CAN ─► FROM_BUS, TO_BUS ─► CAN
//!                 frames ► on_bus, host bytes ► on_host_bytes     storing      STORE ─► flash ─► STORED
//!                 tick ► frames for bus and host                  housekeeping watchdog, log, LED
//! ```
//!
//! The coordinator belongs to the control task alone, so nothing is locked. The IMU comes first in every turn: what a
//! host says, however much, is parsed when the motion is out, and at most [`HOST_BYTES`] of it in a turn.
//!
//! The library is the simulator's; only the shell around it is ours. A task is a plain function
//! over the peripherals; the board gives it its place, as tasks of an executor cannot be generic.

use embassy_futures::select::select3;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Instant, Ticker, Timer};
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::SpiDevice;
use sarah_protocol::bus::Frame;
use sarah_protocol::params::ParamSet;
use static_cell::{ConstStaticCell, StaticCell};

use super::boot::BootReport;
use super::can::{Can, Port};
use super::imu::Imu;
use super::vitals::{Pulse, Vitals};
use crate::coordinator::{Action, BusOutbox, Config, Coordinator, HostOutbox, Identity, ImuSample};
use crate::store::{Flash, Loaded, Slot, Step, Store};

/// Between two turns of the control task: the IMU's rate.
pub const PERIOD_US: u32 = 1_000;
/// Host bytes parsed in a turn: somewhat more than come in one at 1 Mbaud.
const HOST_BYTES: usize = 128;
/// Frames from the bus that may wait for a turn: three nodes say less than one each in that time.
const FRAMES: usize = 8;
/// Turns without a sample after which the IMU is set up anew, and again after as many.
const IMU_PATIENCE: u32 = 100;

/// The timer of the turns.
pub trait Turns {
    /// Waits for the next turn.
    fn next(&mut self) -> impl Future<Output = ()>;
}

/// The host link: bytes in, frames out. Nothing here waits.
pub trait HostLink {
    /// Takes what has arrived, at most `into` holds.
    fn read(&mut self, into: &mut [u8]) -> usize;
    /// Whether [`HostLink::send`] would take a frame.
    fn is_free(&mut self) -> bool;
    /// Begins to send, if the last frame is out.
    fn send(&mut self, frame: &[u8]);
}

/// What housekeeping needs of a board.
pub trait House {
    /// Feeds the watchdog.
    fn feed(&mut self);
    /// The LED.
    fn light(&mut self, on: bool);
    /// Turns since the start, and those that came while the last was still at work; both wrap.
    fn turns(&self) -> (u32, u32);
}

static FROM_BUS: Channel<CriticalSectionRawMutex, Frame, FRAMES> = Channel::new();
/// Short, so that a halt does not wait behind what was queued before it.
static TO_BUS: Channel<CriticalSectionRawMutex, Frame, 2> = Channel::new();
static STORE: Signal<CriticalSectionRawMutex, (ParamSet, u32)> = Signal::new();
static STORED: Signal<CriticalSectionRawMutex, (u32, bool)> = Signal::new();
static CONTROL_PULSE: Pulse = Pulse::new();
static BUS_PULSE: Pulse = Pulse::new();
static LINK_PULSE: Pulse = Pulse::new();
/// Turns without a sample.
static BLIND: Pulse = Pulse::new();
/// Frames from the bus that found the queue full. Everything that matters is repeated.
static DROPPED: Pulse = Pulse::new();

/// The store, and the set to begin with.
#[inline(never)]
pub fn recall(nvm: &impl Flash) -> (&'static mut Store, ParamSet) {
    static STORE: StaticCell<Store> = StaticCell::new();
    let (store, loaded) = Store::load(nvm, &crate::default_params());
    tell(&loaded);
    (STORE.init(store), loaded.set)
}

/// Name of this build for the hello: the version, padded with zeros.
const BUILD: [u8; 16] = {
    let version = env!("CARGO_PKG_VERSION").as_bytes();
    let mut build = [0; 16];
    let mut index = 0;
    while index < version.len() && index < build.len() {
        build[index] = version[index];
        index += 1;
    }
    build
};

/// The coordinator. `board` tells the host which board it runs on.
#[inline(never)]
pub fn born(report: &BootReport, board: u8, stored: ParamSet) -> &'static mut Coordinator {
    static COORDINATOR: StaticCell<Coordinator> = StaticCell::new();
    let identity = Identity { boot_nonce: report.nonce, board, build: BUILD, reset_cause: report.cause };
    let config = Config { imu_period_us: PERIOD_US, ..Config::new(identity, crate::default_params(), stored) };
    COORDINATOR.init_with(|| Coordinator::new(config))
}

/// Says which set was loaded, and why the other slot was not.
fn tell(loaded: &Loaded) {
    let [a, b] = loaded.slots.map(|slot| slot.words());
    match loaded.from {
        Some((slot, kept)) => {
            let name = if slot == Slot::A { "A" } else { "B" };
            defmt::info!("parameters: slot {=str}, stored as generation {=u32}", name, kept.generation);
        }
        None => defmt::warn!("parameters: the built-in set"),
    }
    defmt::info!("slot A: {=str}; slot B: {=str}", a, b);
}

/// The control task's peripherals.
pub struct Control<T, S, U, D> {
    ticks: T,
    imu: Imu<S>,
    uart: U,
    delay: D,
    /// Turns since the last sample.
    blind: u32,
}

impl<T: Turns, S: SpiDevice, U: HostLink, D: DelayNs> Control<T, S, U, D> {
    /// The IMU on `spi` is set up in the first turn. `delay` counts cycles.
    pub fn new(ticks: T, spi: S, uart: U, delay: D) -> Control<T, S, U, D> {
        Control { ticks, imu: Imu::new(spi), uart, delay, blind: IMU_PATIENCE }
    }

    fn sample(&mut self) -> Option<ImuSample> {
        let sample = self.imu.read().ok();
        match sample {
            Some(_) => self.blind = 0,
            None => {
                BLIND.beat();
                self.blind += 1;
            }
        }
        if self.blind > IMU_PATIENCE {
            // Takes two turns, in which nothing moves: the coordinator has long halted.
            self.blind = 0;
            let _ = self.imu.start(&mut self.delay);
        }
        sample
    }
}

/// What goes out.
struct Outboxes {
    bus: BusOutbox,
    host: HostOutbox,
}

// The turn in three parts, each without anything of the board's, and each a function of its own, so that the images can
// be searched for what is reachable from them.

/// The part that comes first and waits for nothing.
#[inline(never)]
fn imu_tick(coordinator: &mut Coordinator, now_us: u32, sample: &ImuSample, out: &mut Outboxes) {
    coordinator.on_imu(now_us, sample, &mut out.bus);
}

#[inline(never)]
fn bus_tick(coordinator: &mut Coordinator, now_us: u32, frame: &Frame, out: &mut Outboxes) {
    coordinator.on_bus(now_us, frame, &mut out.bus, &mut out.host);
}

/// Host, store and clock.
#[inline(never)]
fn control_tick(
    coordinator: &mut Coordinator,
    now_us: u32,
    bytes: &[u8],
    stored: Option<(u32, bool)>,
    Outboxes { bus, host }: &mut Outboxes,
) -> Option<Action> {
    coordinator.on_host_bytes(now_us, bytes, bus, host);
    if let Some((generation, ok)) = stored {
        coordinator.on_stored(generation, ok, host);
    }
    coordinator.tick(now_us, bus, host)
}

fn flush(bus: &mut BusOutbox) {
    while !TO_BUS.is_full() {
        let Some(frame) = bus.pop() else { break };
        // There is room: this task alone sends.
        let _ = TO_BUS.try_send(frame);
    }
}

/// The control task; never ends.
pub async fn turns<T: Turns, S: SpiDevice, U: HostLink, D: DelayNs>(
    mut io: Control<T, S, U, D>,
    coordinator: &'static mut Coordinator,
) {
    static OUT: ConstStaticCell<Outboxes> =
        ConstStaticCell::new(Outboxes { bus: BusOutbox::new(), host: HostOutbox::new() });
    static BYTES: ConstStaticCell<[u8; HOST_BYTES]> = ConstStaticCell::new([0; HOST_BYTES]);
    let (out, bytes) = (OUT.take(), BYTES.take());
    loop {
        io.ticks.next().await;
        let now_us = Instant::now().as_micros() as u32;
        if let Some(sample) = io.sample() {
            imu_tick(coordinator, now_us, &sample, out);
            flush(&mut out.bus);
        }
        for _ in 0..FRAMES {
            let Ok(frame) = FROM_BUS.try_receive() else { break };
            bus_tick(coordinator, now_us, &frame, out);
        }
        let count = io.uart.read(bytes);
        let heard = bytes.get(..count).unwrap_or_default();
        if let Some(Action::Store(set, generation)) = control_tick(coordinator, now_us, heard, STORED.try_take(), out) {
            STORE.signal((set, generation));
        }
        flush(&mut out.bus);
        // A frame is out within three turns; a link that stays busy is dead, and so is its pulse.
        if io.uart.is_free() {
            LINK_PULSE.beat();
            if let Some(frame) = out.host.pop() {
                io.uart.send(&frame);
            }
        }
        CONTROL_PULSE.beat();
    }
}

/// The longest the bus task sleeps: an empty bus is no reason to look dead.
const BUS_IDLE: Duration = Duration::from_millis(10);
/// What the bus does not take for this long is dropped: when a dead bus lives again, an old word, above all one that says
/// armed, must not be heard as a new one. What matters is repeated.
const STALE: Duration = Duration::from_millis(10);

/// The bus task; never ends.
pub async fn bus<P: Port>(mut can: Can<P>) {
    let mut unsent: Option<Frame> = None;
    let mut full_since: Option<Instant> = None;
    loop {
        let work = core::future::poll_fn(|context| match unsent {
            // Room in the controller comes with an event.
            Some(_) => core::task::Poll::Pending,
            None => TO_BUS.poll_ready_to_receive(context),
        });
        select3(can.event(), work, Timer::after(BUS_IDLE)).await;
        while let Some(frame) = can.receive() {
            if FROM_BUS.try_send(frame).is_err() {
                DROPPED.beat();
            }
        }
        while let Some(frame) = unsent.take().or_else(|| TO_BUS.try_receive().ok()) {
            if let Err(frame) = can.send(frame) {
                unsent = Some(frame);
                break;
            }
            // A bus that takes anything lives, however full the queue.
            full_since = None;
        }
        full_since = unsent.as_ref().map(|_| full_since.unwrap_or_else(Instant::now));
        if full_since.is_some_and(|since| since.elapsed() >= STALE) {
            can.take_back();
            (unsent, full_since) = (None, None);
            while TO_BUS.try_receive().is_ok() {}
        }
        can.recover();
        BUS_PULSE.beat();
    }
}

/// Between two steps of a write; the longest operation takes six.
const STEP: Duration = Duration::from_millis(1);

/// The task that stores parameter sets; never ends.
pub async fn storing(store: &'static mut Store, mut nvm: impl Flash) {
    loop {
        let (set, generation) = STORE.wait().await;
        store.write(&set, generation, BUILD);
        loop {
            match store.step(&mut nvm) {
                Step::Busy => Timer::after(STEP).await,
                Step::Stored { generation } => {
                    STORED.signal((generation, true));
                    break;
                }
                Step::Failed { generation, .. } => {
                    defmt::error!("parameters: generation {=u32} could not be stored", generation);
                    STORED.signal((generation, false));
                    break;
                }
                Step::Idle => break,
            }
        }
    }
}

/// Between two looks at the vitals.
const LOOK: Duration = Duration::from_millis(10);
/// Looks between two lines of log.
const LOOKS_PER_LINE: u32 = 100;

/// The watchdog is fed only if control, bus and host link all live; never ends.
pub async fn housekeeping(mut house: impl House) {
    let mut vitals = Vitals::new();
    let mut ticker = Ticker::every(LOOK);
    let mut looks = 0_u32;
    loop {
        ticker.next().await;
        if vitals.all_alive([CONTROL_PULSE.count(), BUS_PULSE.count(), LINK_PULSE.count()]) {
            house.feed();
        }
        looks = looks.wrapping_add(1);
        house.light(!(looks / 50).is_multiple_of(2));
        if looks.is_multiple_of(LOOKS_PER_LINE) {
            let (turns, late) = house.turns();
            defmt::info!(
                "{=u32} turns, {=u32} late, {=u32} without IMU; {=u32} frames dropped",
                turns,
                late,
                BLIND.count(),
                DROPPED.count(),
            );
        }
    }
}
