//! The bus: a Bosch M_CAN in CAN-FD on the `mcan` crate. Which controller, its clock and its pins are the board's.
//!
//! 1 Mbit/s, 2 Mbit/s in the data phase. A motion message (48 bytes) takes about 0.27 ms. In the data phase a
//! transmitter hears its own bit later than the bit lasts with a slow transceiver, so it compares at the measured delay
//! plus the sample point (TDCO).
//!
//! One task owns the controller. Its interrupt only masks itself and wakes that task, which serves the flags and
//! unmasks. Sending is first in, first out: the flags of the gait must keep their order; who has something more urgent
//! keeps the queue here short.

use core::future::poll_fn;
use core::task::Poll;

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;
use embassy_sync::waitqueue::AtomicWaker;
use heapless::Vec;
use mcan::bus::{Can as Controller, CanConfigurable};
use mcan::config::{BitTiming, Mode};
use mcan::embedded_can::{Id, StandardId};
use mcan::filter::{Action, Filter};
use mcan::generic_array::typenum::consts::{U0, U4, U16};
use mcan::interrupt::{Interrupt as Event, InterruptSet, OwnedInterruptSet, state};
use mcan::message::{rx, tx};
use mcan::messageram::{Capacities, SharedMemory};
use mcan::prelude::*;
use mcan_core::{CanId, Dependencies};
use sarah_protocol::bus::Frame;

/// A controller on a board.
pub trait Port {
    /// Which controller.
    type Id: CanId;
    /// Proof that its clocks and pins are set up.
    type Ready: Dependencies<Self::Id>;
    /// The controller's interrupt line.
    type Line: InterruptNumber;
    /// That line; its handler calls [`on_interrupt`].
    const LINE: Self::Line;
    /// 1 Mbit/s, exactly.
    const NOMINAL: BitTiming;
    /// 2 Mbit/s, exactly, with quanta of one clock period.
    const DATA: BitTiming;
}

/// What the message RAM holds: 16 frames received, 4 to send.
pub struct Memory;
impl Capacities for Memory {
    type StandardFilters = U4;
    type ExtendedFilters = U0;
    type RxBufferMessage = rx::Message<64>;
    type DedicatedRxBuffers = U0;
    type RxFifo0Message = rx::Message<64>;
    type RxFifo0 = U16;
    type RxFifo1Message = rx::Message<64>;
    type RxFifo1 = U0;
    type TxMessage = tx::Message<64>;
    type TxBuffers = U4;
    type DedicatedTxBuffers = U0;
    type TxEventFifo = U0;
}

static WAKER: AtomicWaker = AtomicWaker::new();

/// To be called by the controller's interrupt.
pub fn on_interrupt(line: impl InterruptNumber) {
    NVIC::mask(line);
    WAKER.wake();
}

/// What happened on the bus since the start; each wraps.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, defmt::Format)]
pub struct Statistics {
    /// Frames received.
    pub received: u32,
    /// Frames sent.
    pub sent: u32,
    /// Times frames were lost because nobody fetched them.
    pub lost: u32,
    /// Times the controller left the bus because of errors, and was sent back.
    pub bus_off: u32,
}

/// The bus as one task uses it.
pub struct Can<P: Port> {
    controller: Controller<'static, P::Id, P::Ready, Memory>,
    events: OwnedInterruptSet<P::Id, state::EnabledLine0>,
    statistics: Statistics,
}

fn watched() -> InterruptSet {
    [Event::RxFifo0NewMessage, Event::RxFifo0MessageLost, Event::TransmissionCompleted, Event::BusOff]
        .into_iter()
        .collect()
}

impl<P: Port> Can<P> {
    /// Joins the bus; hears identifiers within `accepts` (at most 4 ranges). `memory` is initialised RAM: what the
    /// controller reads must not be left over from another life. The line is not enabled here.
    pub fn join(ready: P::Ready, memory: &'static mut SharedMemory<Memory>, accepts: &[(u16, u16)]) -> Option<Can<P>> {
        let mut setup = CanConfigurable::new(P::NOMINAL.bitrate, ready, memory).ok()?;
        setup.config().nominal_timing = P::NOMINAL;
        setup.config().mode = Mode::Fd { allow_bit_rate_switching: true, data_phase_timing: P::DATA };
        for (low, high) in accepts {
            let (low, high) = (StandardId::new(*low)?, StandardId::new(*high)?);
            setup.filters_standard().push(Filter::Range { action: Action::StoreFifo0, low, high }).ok()?;
        }
        // This writes the bit timing registers as a whole; the compensation, which the crate does not know, comes after.
        let mut controller = setup.finalize_initialized().ok()?;
        compensate::<P>(&controller);
        let events = controller.interrupts.split(watched()).ok()?;
        let events = controller.interrupt_configuration.enable_line_0(events);
        controller.tx.enable_transmission_completed_interrupt((0..4_usize).collect());
        controller.aux.operational_mode();
        Some(Can { controller, events, statistics: Statistics::default() })
    }

    /// Queues a frame; gives it back if the queue is full.
    pub fn send(&mut self, frame: Frame) -> Result<(), Frame> {
        let Some(id) = StandardId::new(frame.id) else { return Ok(()) };
        let built = tx::MessageBuilder {
            id: Id::Standard(id),
            frame_type: tx::FrameType::FlexibleDatarate {
                payload: &frame.data,
                bit_rate_switching: true,
                force_error_state_indicator: false,
            },
            store_tx_event: None,
        }
        .build();
        // Not built: a length CAN-FD does not have. The protocol pads its frames, so this does not happen.
        let Ok(message) = built else { return Ok(()) };
        match self.controller.tx.transmit_queued(message) {
            Ok(()) => {
                self.statistics.sent = self.statistics.sent.wrapping_add(1);
                Ok(())
            }
            Err(_) => Err(frame),
        }
    }

    /// Takes back whatever has not been sent yet.
    pub fn take_back(&mut self) {
        // Done when the attempt under way has ended; there is no other attempt.
        let _ = self.controller.tx.cancel_multi((0..4_usize).collect());
    }

    /// The next frame received.
    pub fn receive(&mut self) -> Option<Frame> {
        // A frame has room for what the controller can receive.
        self.receive_with(|id, data| Frame { id, data: Vec::from_slice(data).unwrap_or_default() })
    }

    /// What `use_it` makes of identifier and payload of the next frame received, without a copy.
    pub fn receive_with<R>(&mut self, use_it: impl FnOnce(u16, &[u8]) -> R) -> Option<R> {
        loop {
            let Ok(message) = self.controller.rx_fifo_0.receive() else { return None };
            let Id::Standard(id) = message.id() else { continue };
            self.statistics.received = self.statistics.received.wrapping_add(1);
            return Some(use_it(id.as_raw(), message.data()));
        }
    }

    /// Waits until something was received or sent, or the bus was lost.
    pub async fn event(&mut self) {
        poll_fn(|context| {
            WAKER.register(context.waker());
            // What was served since is still noted as pending; what is not served yet notes itself again.
            NVIC::unpend(P::LINE);
            let flags = self.events.interrupt_flags();
            if flags.is_empty() {
                // SAFETY: no critical section relies on this mask.
                unsafe { NVIC::unmask(P::LINE) };
                return Poll::Pending;
            }
            self.events.clear_interrupts(flags);
            if flags.rf0l() {
                self.statistics.lost = self.statistics.lost.wrapping_add(1);
            }
            Poll::Ready(())
        })
        .await
    }

    /// Goes back on the bus if the controller has left it; it then waits for 128 × 11 recessive bits by itself. Call
    /// now and then.
    pub fn recover(&mut self) {
        if !self.controller.aux.is_operational() {
            self.statistics.bus_off = self.statistics.bus_off.wrapping_add(1);
            self.controller.aux.operational_mode();
        }
    }

    /// What happened so far.
    pub fn statistics(&self) -> Statistics {
        self.statistics
    }
}

/// Switches transmitter delay compensation on. The second sample point lies where the ordinary one does, counted in clock
/// periods.
fn compensate<P: Port>(controller: &Controller<'static, P::Id, P::Ready, Memory>) {
    // SAFETY: the controller is stopped and these fields are nobody else's.
    unsafe {
        let registers = controller.registers();
        registers.cccr.modify(|_, cccr| cccr.cce().set_bit());
        registers.dbtp.modify(|_, dbtp| dbtp.tdc().set_bit());
        registers.tdcr.write(|tdcr| tdcr.tdco().bits(1 + P::DATA.phase_seg_1));
    }
}
