//! A node image: what runs at which priority, and what passes between.
//!
//! ```text
//!  TC4, 10 kHz ──► control_tick (its own interrupt)           bus task, housekeeping (thread executor)
//!                  collect scan ► Node::control ► outputs     CAN frames ► Message::decode ─► TO_NODE
//!                  begin scan                                 TO_BUS ─► Message::encode ► CAN frames
//!                  one message ► Node::on_message             watchdog, log, LED
//! ```
//!
//! Encoding, decoding and logging never run at the control tick's priority. The node belongs to the tick's handler alone,
//! so nothing is locked; a message waits for the end of a tick, 100 µs at most.

use core::cell::Cell;
use core::future::poll_fn;
use core::sync::atomic::{AtomicU32, Ordering};
use core::task::Poll;

use cortex_m::peripheral::syst::SystClkSource;
use critical_section::Mutex;
use embassy_executor::Executor;
use embassy_futures::select::select3;
use embassy_sync::waitqueue::AtomicWaker;
use embassy_time::{Duration, Instant, Ticker, Timer};
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
use crate::calibration::Calibration;
use crate::node::{Node, NodeConfig};

/// Received, for the node.
static TO_NODE: ConstStaticCell<Queue<Message, 8>> = ConstStaticCell::new(Queue::new());
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
pub struct Board {
    board: &'static NodeBoard,
    /// Why it started.
    pub report: BootReport,
    io: Io,
    bus: BusEnds,
    divider: Option<Divas>,
}

/// What a failed start could not set up.
const NOT_TWICE: &str = "each peripheral is set up once";

impl Board {
    /// Sets everything up: brakes first. Call once, from `main`.
    pub fn start(board: &'static NodeBoard) -> Board {
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
        let scanner = Scanner::start(board.pads).expect(NOT_TWICE);
        let can = Can::start(NODE_ACCEPTS).expect(NOT_TWICE);
        // SAFETY: the one call; the knee's control task alone divides.
        let divider = Some(unsafe { Divas::start() });
        let ticks = Ticks::start(tick::NODE_US);
        let (to_bus, from_node) = TO_BUS.take().split();
        let (to_node, from_bus) = TO_NODE.take().split();
        let calibration = board.calibration;
        let io = Io { calibration, ticks, scanner, outputs, to_bus, from_bus };
        Board { board, report, io, bus: BusEnds { can, to_node, from_node }, divider }
    }

    /// What the node is born with.
    pub fn config(&self, default: ParamSet) -> NodeConfig {
        self.board.config(default, self.report.nonce as u16)
    }

    /// The divider, once.
    pub fn divider(&mut self) -> Divas {
        self.divider.take().expect(NOT_TWICE)
    }

    /// Starts all tasks, and the ticks of `node`.
    pub fn run<N: Node>(self, node: N, control: &'static Control<N>) -> ! {
        let Board { board, report, io, bus: ends, .. } = self;
        report.log(board.joints);
        control.start(io, node);
        static SLOW: StaticCell<Executor> = StaticCell::new();
        SLOW.init(Executor::new()).run(|spawner| {
            spawner.spawn(bus(ends).expect(NOT_TWICE));
            spawner.spawn(housekeeping(Watchdog::start()).expect(NOT_TWICE));
        })
    }
}

/// A node and what it controls. An image has one, and runs it in the handler of [`tick::HANDLER`].
pub struct Control<N: 'static> {
    place: StaticCell<(Io, N)>,
    /// Taken by the handler for the time of a tick, so that nothing is locked meanwhile.
    at_rest: Mutex<Cell<Option<&'static mut (Io, N)>>>,
}

impl<N: Node> Control<N> {
    /// Nothing to control yet.
    pub const fn new() -> Control<N> {
        Control { place: StaticCell::new(), at_rest: Mutex::new(Cell::new(None)) }
    }

    fn start(&'static self, io: Io, node: N) {
        let both = self.place.init((io, node));
        both.0.ticks.handle();
        critical_section::with(|lock| self.at_rest.borrow(lock).set(Some(both)));
    }

    /// Serves the ticks since the last time. For the handler of [`tick::HANDLER`] alone.
    #[inline]
    pub fn on_interrupt(&self) {
        let Some(both) = critical_section::with(|lock| self.at_rest.borrow(lock).take()) else { return };
        let (io, node) = &mut *both;
        let dt_us = io.ticks.passed();
        if dt_us != 0 {
            if control_tick(io, node, dt_us) {
                BUS_WAKER.wake();
            }
            CONTROL_PULSE.beat();
        }
        critical_section::with(|lock| self.at_rest.borrow(lock).set(Some(both)));
    }
}

impl<N: Node> Default for Control<N> {
    fn default() -> Self {
        Control::new()
    }
}

/// The peripherals of the control tick and its ends of the queues.
pub struct Io {
    /// A copy: the flash would make every look at it wait.
    calibration: Calibration,
    ticks: Ticks,
    scanner: Scanner,
    outputs: Outputs,
    to_bus: Sender<'static, Message, 16>,
    from_bus: Receiver<'static, Message, 8>,
}

/// To the bus task.
#[inline(never)]
fn say(to_bus: &mut Sender<'static, Message, 16>, message: Message) {
    if to_bus.send(message).is_err() {
        UNSENT.beat();
    }
}

/// One tick; whether there is something to send. A function of its own, so that the images can be searched for what is
/// reachable from it.
#[inline(never)]
fn control_tick<N: Node>(io: &mut Io, node: &mut N, dt_us: u32) -> bool {
    let sensors = io.scanner.collect(&io.calibration);
    let mut spoke = false;
    let drive = node.control(dt_us, sensors, &mut |message| {
        say(&mut io.to_bus, message);
        spoke = true;
    });
    io.outputs.set(&drive, &io.calibration);
    io.scanner.begin();
    if let Some(Some(answer)) = io.from_bus.receive_with(|message| node.on_message(message)) {
        say(&mut io.to_bus, answer);
        spoke = true;
    }
    spoke
}

/// The bus task's controller and its ends of the queues.
struct BusEnds {
    can: Can,
    to_node: Sender<'static, Message, 8>,
    from_node: Receiver<'static, Message, 16>,
}

/// The longest the bus task sleeps: an empty bus is no reason to look dead.
const BUS_IDLE: Duration = Duration::from_millis(10);

#[embassy_executor::task]
async fn bus(ends: BusEnds) -> ! {
    let BusEnds { mut can, mut to_node, mut from_node } = ends;
    let mut unsent: Option<Frame> = None;
    loop {
        let work = poll_fn(|context| {
            BUS_WAKER.register(context.waker());
            // With a frame waiting for room, room comes with an event of the controller.
            if unsent.is_none() && !from_node.is_empty() { Poll::Ready(()) } else { Poll::Pending }
        });
        select3(can.event(), work, Timer::after(BUS_IDLE)).await;
        while let Some(frame) = can.receive() {
            // What does not decode is dropped, as in the simulator.
            if let Ok(message) = Message::decode(&frame)
                && to_node.send(message).is_err()
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

/// Between two looks at the vitals.
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
