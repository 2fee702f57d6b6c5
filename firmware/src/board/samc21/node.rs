//! A node image: what runs at which priority, and what passes between.
//!
//! ```text
//!  TC4, 10 kHz ──► control task (interrupt executor)          bus task, housekeeping (thread executor)
//!                  collect scan ► Node::tick ► outputs         CAN frames ► Message::decode ─► TO_NODE
//!                  one message ► Node::on_message              TO_BUS ─► Message::encode ► CAN frames
//!                  begin scan                                  watchdog, log, LED
//! ```
//!
//! Encoding, decoding and logging never run at the control task's priority. The node belongs to the control task alone,
//! so nothing is locked; a message waits for the end of a tick, 100 µs at most.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::syst::SystClkSource;
use embassy_executor::{Executor, InterruptExecutor, SendSpawner};
use embassy_futures::select::select3;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use embassy_time::{Duration, Instant, Ticker, Timer};
use sarah_protocol::bus::{Frame, Message};
use sarah_protocol::params::ParamSet;
use static_cell::StaticCell;

use super::adc::Scanner;
use super::boot::BootReport;
use super::can::Can;
use super::divider::Divas;
use super::outputs::{self, Outputs};
use super::tick::{self, Ticks};
use super::vectors::{interrupt, priority};
use super::vitals::{Pulse, Vitals};
use super::watchdog::Watchdog;
use super::wiring::{LED, NODE_ACCEPTS, NodeBoard};
use super::{clocks, dma, fault, log, time_driver};
use crate::node::{Node, NodeConfig};

static TO_NODE: Channel<CriticalSectionRawMutex, Message, 8> = Channel::new();
static TO_BUS: Channel<CriticalSectionRawMutex, Message, 16> = Channel::new();
static CONTROL_PULSE: Pulse = Pulse::new();
static BUS_PULSE: Pulse = Pulse::new();
/// Messages that found a queue full; wraps. Everything that matters is repeated.
static DROPPED: AtomicU32 = AtomicU32::new(0);
static CONTROL: InterruptExecutor = InterruptExecutor::new();

/// The control task's executor runs in the line of a peripheral this firmware does not use.
#[cortex_m_rt::interrupt]
fn PTC() {
    // SAFETY: called from its interrupt, which is enabled by `CONTROL.start`.
    unsafe { CONTROL.on_interrupt() }
}

/// Counts a message that was not taken.
fn count_drop<T, E>(result: Result<T, E>) {
    if result.is_err() {
        critical_section::with(|_| DROPPED.store(DROPPED.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed));
    }
}

/// A node board, set up and braked; nothing runs yet.
pub struct Board {
    board: &'static NodeBoard,
    /// Why it started.
    pub report: BootReport,
    control: Control,
    can: Can,
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
        let control = Control { board, ticks, scanner, outputs };
        Board { board, report, control, can, divider }
    }

    /// What the node is born with.
    pub fn config(&self, default: ParamSet) -> NodeConfig {
        self.board.config(default, self.report.nonce as u16)
    }

    /// The divider, once.
    pub fn divider(&mut self) -> Divas {
        self.divider.take().expect(NOT_TWICE)
    }

    /// Starts all tasks; `spawn` starts the control task.
    pub fn run(self, spawn: impl FnOnce(SendSpawner, Control)) -> ! {
        let Board { board, report, control, can, .. } = self;
        defmt::info!("{=str}: started, {}", board.joints, defmt::Debug2Format(&report));
        // SAFETY: before the executor starts; no critical section relies on this priority.
        unsafe { cortex_m::Peripherals::steal().NVIC.set_priority(interrupt::PTC, priority::CONTROL) };
        spawn(CONTROL.start(interrupt::PTC), control);
        static SLOW: StaticCell<Executor> = StaticCell::new();
        SLOW.init(Executor::new()).run(|spawner| {
            spawner.spawn(bus(can).expect(NOT_TWICE));
            spawner.spawn(housekeeping(Watchdog::start()).expect(NOT_TWICE));
        })
    }
}

/// The control task's peripherals.
pub struct Control {
    board: &'static NodeBoard,
    ticks: Ticks,
    scanner: Scanner,
    outputs: Outputs,
}

impl Control {
    /// The control loop, for ever.
    pub async fn run<N: Node>(mut self, mut node: N) -> ! {
        let calibration = &self.board.calibration;
        loop {
            let dt_us = self.ticks.next().await;
            let sensors = calibration.sensors(&self.scanner.collect());
            let out = node.tick(dt_us, &sensors);
            self.outputs.set(out.drive.map(|drive| calibration.command(drive)));
            for message in out.messages {
                count_drop(TO_BUS.try_send(message));
            }
            self.scanner.begin();
            if let Ok(message) = TO_NODE.try_receive()
                && let Some(answer) = node.on_message(&message)
            {
                count_drop(TO_BUS.try_send(answer));
            }
            CONTROL_PULSE.beat();
        }
    }
}

/// The longest the bus task sleeps: an empty bus is no reason to look dead.
const BUS_IDLE: Duration = Duration::from_millis(10);

#[embassy_executor::task]
async fn bus(mut can: Can) -> ! {
    let mut unsent: Option<Frame> = None;
    loop {
        let work = core::future::poll_fn(|context| match unsent {
            // Room in the controller comes with an event.
            Some(_) => core::task::Poll::Pending,
            None => TO_BUS.poll_ready_to_receive(context),
        });
        select3(can.event(), work, Timer::after(BUS_IDLE)).await;
        while let Some(frame) = can.receive() {
            // What does not decode is dropped, as in the simulator.
            if let Ok(message) = Message::decode(&frame) {
                count_drop(TO_NODE.try_send(message));
            }
        }
        while let Some(frame) = unsent.take().or_else(|| TO_BUS.try_receive().ok().map(|message| message.encode())) {
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
        LED.pin.set(looks / 50 % 2 == 0);
        if looks % LOOKS_PER_LINE == 0 {
            let [received, sent, lost, bus_off] = &SHARED.0;
            defmt::info!(
                "{=u64} ms: {=u32} ticks, {=u32} overrun; bus {=u32} in, {=u32} out, {=u32} lost, {=u32} off; {=u32} dropped",
                Instant::now().as_millis(),
                tick::raised(),
                tick::overruns(),
                received.load(Ordering::Relaxed),
                sent.load(Ordering::Relaxed),
                lost.load(Ordering::Relaxed),
                bus_off.load(Ordering::Relaxed),
                DROPPED.load(Ordering::Relaxed),
            );
        }
    }
}
