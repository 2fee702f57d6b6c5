//! A node image: what runs at which priority, and what passes between.
//!
//! ```text
//!  TC4, 10 kHz ──► control_tick (its own interrupt)            bus task, housekeeping (thread executor)
//!                  collect scan ► Controller::control ► outputs   CAN frames ► Message::decode ► Ear::hear ─► to_node
//!                  begin scan                                     TO_BUS ─► Message::encode ► CAN frames
//!                  one message ► Controller::take_in              watchdog, log, LED
//! ```
//!
//! Encoding, decoding and logging never run at the control tick's priority, nor does what follows from a message alone. The
//! node belongs to the tick's handler alone, so nothing is locked; a message waits for the end of a tick, 100 µs at most.
//! What the tick executes lies in RAM (`fast.x`), for the flash makes the core wait.

use core::cell::UnsafeCell;
use core::future::poll_fn;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicU32, Ordering};
use core::task::Poll;

use cortex_m::peripheral::syst::SystClkSource;
use embassy_executor::{Executor, SpawnToken};
use embassy_futures::select::select;
use embassy_sync::waitqueue::AtomicWaker;
use embassy_time::{Duration, Instant, Ticker};
use sarah_protocol::bus::{Frame, Message};
use sarah_protocol::params::ParamSet;
use static_cell::{ConstStaticCell, StaticCell};

use super::adc::Scanner;
use super::boot::BootReport;
use super::can::Can;
use super::divider::Divas;
use super::outputs::{self, Outputs};
use super::queue::{Queue, Receiver, Sender};
use super::tick::{self, Ticks};
use super::vitals::{Pulse, Vitals};
use super::watchdog::Watchdog;
use super::wiring::{LED, NODE_ACCEPTS, NodeBoard};
use super::{clocks, dma, fault, log, time_driver};
use crate::node::heard::{Ear, Heard};
use crate::node::{Controller, NodeConfig};

/// One of the node images.
pub trait Place: 'static {
    /// Its board. Constant, so that the tick has no calibration to look up.
    const BOARD: NodeBoard;
    /// What hears.
    type Ear: Ear;
    /// What ticks.
    type Node: Controller<Heard = HeardAt<Self>>;
}

/// What the node of an image hears.
pub type HeardAt<P> = Heard<<<P as Place>::Ear as Ear>::Motion, <<P as Place>::Ear as Ear>::Params>;
/// Received, for the node. An image has one, and calls it `TO_NODE`: there an emulator finds it.
pub type ToNode<P> = ConstStaticCell<Queue<HeardAt<P>, 8>>;
/// From the node, to be sent: two ticks of the busiest kind.
static TO_BUS: ConstStaticCell<Queue<Message, 16>> = ConstStaticCell::new(Queue::new());
/// Wakes the bus task.
static BUS_WAKER: AtomicWaker = AtomicWaker::new();
static CONTROL_PULSE: Pulse = Pulse::new();
static BUS_PULSE: Pulse = Pulse::new();
/// Messages of the node, and for it, that found a queue full; each wraps. What matters is repeated.
static UNSENT: Pulse = Pulse::new();
static UNHEARD: Pulse = Pulse::new();

/// A node board, set up and braked; nothing runs yet.
pub struct Board<P: Place> {
    io: Io<P>,
    bus: Bus<P>,
    report: BootReport,
}

/// What a failed start could not set up.
const NOT_TWICE: &str = "each peripheral is set up once";

impl<P: Place> Board<P> {
    /// Sets everything up: brakes first. `hears` makes the ear. Call once, from `main`.
    pub fn start(to_node: &'static ToNode<P>, hears: impl FnOnce(Divas) -> P::Ear) -> Board<P> {
        outputs::brake_now();
        log::start();
        // SAFETY: the first to touch the core's peripherals.
        let mut core = unsafe { cortex_m::Peripherals::steal() };
        // Runs freely while the crystal starts: the source of the boot nonce.
        core.SYST.set_clock_source(SystClkSource::Core);
        core.SYST.set_reload(0x00ff_ffff);
        core.SYST.clear_current();
        core.SYST.enable_counter();
        let report = fault::report(clocks::start());
        core.SYST.disable_counter();
        time_driver::start();
        dma::start();
        let outputs = Outputs::start();
        let scanner = Scanner::start(P::BOARD.pads).expect(NOT_TWICE);
        let can = Can::start(NODE_ACCEPTS).expect(NOT_TWICE);
        // SAFETY: the one call; the ear alone divides, in the bus task.
        let ear = hears(unsafe { Divas::start() });
        let ticks = Ticks::start(tick::NODE_US);
        let (to_bus, from_node) = TO_BUS.take().split();
        let (to_node, from_bus) = to_node.take().split();
        let io = Io { ticks, scanner, outputs, to_bus, from_bus };
        Board { io, bus: Bus { can, ear, to_node, from_node }, report }
    }

    /// What the node is born with.
    pub fn config(&self, default: ParamSet) -> NodeConfig {
        P::BOARD.config(default, self.report.nonce as u16)
    }

    /// What the node hears with.
    pub fn ear(&self) -> &P::Ear {
        &self.bus.ear
    }

    /// Starts all tasks, that of [`Bus::serve`] included, and the ticks of `node`.
    pub fn run<S>(self, node: P::Node, control: &'static Control<P>, serve: impl FnOnce(Bus<P>) -> SpawnToken<S>) -> ! {
        let Board { report, io, bus } = self;
        report.log(P::BOARD.joints);
        control.start(io, node);
        static SLOW: StaticCell<Executor> = StaticCell::new();
        SLOW.init(Executor::new()).run(|spawner| {
            spawner.spawn(serve(bus));
            spawner.spawn(housekeeping(Watchdog::start()).expect(NOT_TWICE));
        })
    }
}

/// A node and what it controls. An image has one, and runs it in the handler of [`tick::HANDLER`].
pub struct Control<P: Place>(UnsafeCell<MaybeUninit<(Io<P>, P::Node)>>);

// SAFETY: `start` fills it before it enables the handler's line, and the handler alone touches it from then on.
unsafe impl<P: Place> Sync for Control<P> {}

impl<P: Place> Control<P> {
    /// Nothing to control yet.
    pub const fn new() -> Control<P> {
        Control(UnsafeCell::new(MaybeUninit::uninit()))
    }

    /// There is one `Io`, so this is done once.
    fn start(&'static self, io: Io<P>, node: P::Node) {
        // SAFETY: the handler's line is not enabled yet, see above.
        let both = unsafe { (*self.0.get()).write((io, node)) };
        both.0.ticks.handle();
    }

    /// Serves the ticks since the last time.
    ///
    /// # Safety
    /// For the handler of [`tick::HANDLER`] alone, and nobody else enables its line.
    #[inline]
    pub unsafe fn on_interrupt(&self) {
        // SAFETY: `start` has filled it, or the line would not be enabled; a handler does not interrupt itself.
        let (io, node) = unsafe { (*self.0.get()).assume_init_mut() };
        let dt_us = io.ticks.passed();
        if dt_us != 0 {
            if control_tick::<P>(dt_us, io, node) {
                BUS_WAKER.wake();
            }
            CONTROL_PULSE.beat();
        }
    }
}

impl<P: Place> Default for Control<P> {
    fn default() -> Self {
        Control::new()
    }
}

/// The peripherals of the control tick and its ends of the queues.
struct Io<P: Place> {
    ticks: Ticks,
    scanner: Scanner,
    outputs: Outputs,
    to_bus: Sender<'static, Message, 16>,
    from_bus: Receiver<'static, HeardAt<P>, 8>,
}

/// To the bus task.
#[inline(never)]
fn say(to_bus: &mut Sender<'static, Message, 16>, message: Message) {
    if to_bus.send(message).is_err() {
        UNSENT.beat();
    }
}

/// One tick; whether there is something to send. A function of its own, so that the images can be searched for what is
/// reachable from it; the time comes first, where an emulator finds it.
#[inline(never)]
fn control_tick<P: Place>(dt_us: u32, io: &mut Io<P>, node: &mut P::Node) -> bool {
    let Io { scanner, outputs, to_bus, from_bus, .. } = io;
    let calibration = &P::BOARD.calibration;
    let mut spoke = false;
    let mut say = |message| {
        say(to_bus, message);
        spoke = true;
    };
    let drive = node.control(dt_us, scanner.collect(calibration), &mut say);
    outputs.set(&drive, calibration);
    scanner.begin();
    from_bus.receive_with(|heard| node.take_in(heard, &mut say));
    spoke
}

/// The node on the bus: the controller, what hears, and its ends of the queues.
pub struct Bus<P: Place> {
    can: Can,
    ear: P::Ear,
    to_node: Sender<'static, HeardAt<P>, 8>,
    from_node: Receiver<'static, Message, 16>,
}

impl<P: Place> Bus<P> {
    /// Receives and sends. For a task of the image.
    pub async fn serve(self) -> ! {
        let Bus { mut can, ear, mut to_node, mut from_node } = self;
        let mut unsent: Option<Frame> = None;
        loop {
            let mut woken = false;
            let work = poll_fn(|context| {
                BUS_WAKER.register(context.waker());
                // With a frame waiting for room, room comes with an event of the controller. Whoever wakes the task shall
                // see it alive.
                let ready = unsent.is_none() && !from_node.is_empty();
                if core::mem::replace(&mut woken, true) || ready { Poll::Ready(()) } else { Poll::Pending }
            });
            select(can.event(), work).await;
            while let Some(message) = can.receive_with(Message::of) {
                // What does not decode is dropped, as in the simulator.
                if let Ok(message) = message
                    && to_node.send(ear.hear(&message)).is_err()
                {
                    UNHEARD.beat();
                }
            }
            while let Some(frame) = unsent.take().or_else(|| from_node.receive().map(|message| message.encode())) {
                if let Err(frame) = can.send(frame) {
                    unsent = Some(frame);
                    break;
                }
            }
            can.recover();
            BUS_PULSE.beat();
            SHARED.publish(&can);
        }
    }
}

/// Bus counters for the log; written by the bus task, read by housekeeping, both in thread mode.
struct Shared([AtomicU32; 4]);
static SHARED: Shared = Shared([const { AtomicU32::new(0) }; 4]);

impl Shared {
    fn publish(&self, can: &Can) {
        let now = can.statistics();
        for (slot, value) in self.0.iter().zip([now.received, now.sent, now.lost, now.bus_off]) {
            slot.store(value, Ordering::Relaxed);
        }
    }
}

/// Between two looks at the vitals: as long as the bus task may sleep, for an empty bus is no reason to look dead.
const LOOK: Duration = Duration::from_millis(10);
/// Looks between two lines of log.
const LOOKS_PER_LINE: u32 = 100;

#[embassy_executor::task]
async fn housekeeping(mut watchdog: Watchdog) -> ! {
    LED.pin.switch(LED.function);
    let mut vitals = Vitals::new();
    let mut ticker = Ticker::every(LOOK);
    let mut looks = 0_u32;
    loop {
        ticker.next().await;
        if vitals.all_alive([CONTROL_PULSE.count(), BUS_PULSE.count()]) {
            watchdog.feed();
        }
        BUS_WAKER.wake();
        looks = looks.wrapping_add(1);
        LED.pin.set((looks / 50).is_multiple_of(2));
        if looks.is_multiple_of(LOOKS_PER_LINE) {
            let [received, sent, lost, bus_off] = &SHARED.0;
            defmt::info!(
                "{=u64} ms: {=u32} ticks, {=u32} overrun; bus {=u32} in, {=u32} out, {=u32} lost, {=u32} off; {=u32} unheard, {=u32} unsent",
                Instant::now().as_millis(),
                tick::raised(),
                tick::overruns(),
                received.load(Ordering::Relaxed),
                sent.load(Ordering::Relaxed),
                lost.load(Ordering::Relaxed),
                bus_off.load(Ordering::Relaxed),
                UNHEARD.count(),
                UNSENT.count(),
            );
        }
    }
}
