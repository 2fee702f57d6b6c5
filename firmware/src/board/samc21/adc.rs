//! Pads and joint positions: ADC0 scans its inputs between two ticks (data sheet: "ADC").
//!
//! The control task starts a scan at the end of its tick; the converter steps through the inputs by itself (SEQCTRL),
//! DMA puts the results into a buffer, and the next tick collects it. No interrupt, nothing to wait for, and all inputs
//! of a tick are of one moment, 100 µs ago at most. Six conversions take 9 µs: 12 MHz, 13 cycles plus 5 of sampling.
//! Every scan is set up anew, so that a lost trigger spoils one scan and not all that follow.
//!
//! Reference is the analogue supply, from which potentiometers and load cells are fed too: its drift cancels.

use core::cell::UnsafeCell;

use arbitrary_int::{u3, u5, u6};

use super::clocks::{self, Channel, Generator};
use super::dma;
use super::regs::adc::*;
use super::regs::dmac::{Lvl, triggers};
use super::wiring::{ANALOGUE, INPUTS};
use crate::calibration::{Calibration, Counts};
use crate::node::Sensors;
use sarah_protocol::fixed::Q16;

/// The DMA channel of the scan.
const DMA_CHANNEL: u8 = 0;

struct Buffer(UnsafeCell<[u16; INPUTS]>);
// SAFETY: written by DMA during a scan, read by the one scanner between scans.
unsafe impl Sync for Buffer {}
static RESULTS: Buffer = Buffer(UnsafeCell::new([0; INPUTS]));

fn adc() -> MmioAdc<'static> {
    // SAFETY: ADC0 lies there and is used by the one scanner alone.
    unsafe { Adc::new_mmio_at(ADC0) }
}

/// Where the factory noted the converter's bias: NVM software calibration area, word at +0: BIASREFBUF 0–2, BIASCOMP 3–5.
const FACTORY_CALIBRATION: *const u32 = 0x0080_6020 as *const u32;

/// After so many scans in a row that did not finish, 10 ms, there are no positions.
const BLIND_AFTER: u32 = 100;

/// Scans the inputs of a node.
pub struct Scanner {
    dma: dma::Channel,
    latest: Sensors,
    /// Scans in a row that were not finished in time.
    missed: u32,
}

impl Scanner {
    /// Sets the converter up; with `pads`, four pads besides the two positions. Starts the first scan.
    pub fn start(pads: bool) -> Option<Scanner> {
        let inputs = if pads { INPUTS } else { 2 };
        clocks::open_apb(|apb| apb.with_adc0(true));
        clocks::feed(Channel::Adc0, Generator::Cpu);
        let mut adc = adc();
        adc.write_ctrla(CtrlA::ZERO.with_swrst(true));
        while adc.read_syncbusy().swrst() {}
        // SAFETY: a readable word of the calibration area.
        let calibration = unsafe { FACTORY_CALIBRATION.read_volatile() };
        let (buffer, comparator) = (calibration & 7, calibration >> 3 & 7);
        let bias = Calib::ZERO.with_biasrefbuf(u3::new(buffer as u8)).with_biascomp(u3::new(comparator as u8));
        adc.write_calib(bias);
        adc.write_ctrlb(CtrlB::ZERO.with_prescaler(Prescaler::Div4));
        adc.write_refctrl(RefCtrl::ZERO.with_refsel(Refsel::Intvcc2));
        adc.write_inputctrl(InputCtrl::ZERO.with_muxpos(u5::new(0)).with_muxneg(Muxneg::Gnd));
        while adc.read_syncbusy().inputctrl() {}
        adc.write_sampctrl(SampCtrl::ZERO.with_samplen(u6::new(4)));
        while adc.read_syncbusy().sampctrl() {}
        let mut sequence = 0;
        for wire in ANALOGUE.iter().take(inputs) {
            wire.pin.switch(wire.function);
            sequence |= 1 << wire.input;
        }
        adc.write_seqctrl(sequence);
        adc.write_ctrla(CtrlA::ZERO.with_enable(true));
        while adc.read_syncbusy().enable() {}

        // SAFETY: this channel is used here alone.
        let dma = unsafe { dma::Channel::new(DMA_CHANNEL, triggers::ADC0_RESRDY, Lvl::Lvl3) }?;
        let mut scanner = Scanner { dma, latest: Sensors::default(), missed: 0 };
        let transfer = dma::Descriptor {
            control: dma::VALID | dma::HALF_WORD | dma::DESTINATION_INCREMENTS,
            count: inputs as u16,
            source: adc.pointer_to_result() as u32,
            destination: RESULTS.0.get() as u32 + 2 * inputs as u32,
            next: 0,
        };
        // SAFETY: the buffer is static, large enough, and read only when the scan is done or stopped.
        unsafe { scanner.dma.start(transfer) };
        adc.write_swtrig(SwTrig::ZERO.with_start(true));
        Some(scanner)
    }

    /// Starts a scan.
    #[inline]
    pub fn begin(&mut self) {
        // SAFETY: the transfer of `start`; see there.
        unsafe { self.dma.restart() };
        adc().write_swtrig(SwTrig::ZERO.with_start(true));
    }

    /// The scan begun last, or the one before if it is not finished; after [`BLIND_AFTER`] of those, positions that cannot be.
    #[inline]
    pub fn collect(&mut self, calibration: &Calibration) -> &Sensors {
        if self.dma.is_done() {
            // SAFETY: the scan is done, so nothing writes the buffer until the next begins.
            let [left, right, pads @ ..] = unsafe { *RESULTS.0.get() };
            self.latest = calibration.sensors(&Counts { position: [left, right], load: pads });
            self.missed = 0;
        } else {
            self.missed = self.missed.saturating_add(1);
            if self.missed > BLIND_AFTER {
                // No position at all rather than an old one: the node tells, and the robot is halted.
                self.latest.position = [Q16::MAX; 2];
            }
            // Whatever is stuck in the converter must not count as the first input of the next scan.
            adc().write_swtrig(SwTrig::ZERO.with_flush(true));
        }
        &self.latest
    }
}
