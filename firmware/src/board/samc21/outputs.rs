//! Two actuators: pulses, direction, brake coil (data sheet: "TCC").
//!
//! One timer makes all four switching lines: channels 0 and 1 the pulses, 2 and 3 the brake coils as pulses of 0 or
//! 100 %. They change together at the end of a period (50 µs), and together they go low when the debugger halts the
//! chip, until the next reset. **Braked is what happens by itself**: after a reset the pins float and the resistors of
//! `docs/wiring.md` hold them low; a panic or fault takes them from the timer and drives them low ([`brake_now`]).

use super::clocks::{self, CPU_HZ, Channel, Generator};
use super::pins::Function;
use super::regs::tcc::*;
use super::wiring::{BRAKE, DIRECTION, PWM};
use crate::calibration::{Calibration, Command, PWM_PERIOD};
use crate::lpg::Drive;

/// Pulses per second: above hearing.
pub const PWM_HZ: u32 = CPU_HZ / PWM_PERIOD as u32;
/// Compare value that never comes: the line stays high.
const ALWAYS: u32 = PWM_PERIOD as u32;

fn tcc() -> MmioTcc<'static> {
    // SAFETY: TCC0 lies there and is used by the one `Outputs` alone.
    unsafe { Tcc::new_mmio_at(TCC0) }
}

/// The actuators of a node.
pub struct Outputs {
    now: [Drive; 2],
}

impl Outputs {
    /// Sets everything up, braked.
    pub fn start() -> Outputs {
        brake_now();
        for wire in DIRECTION {
            wire.pin.switch(wire.function);
        }
        clocks::open_apb(|apb| apb.with_tcc0(true));
        clocks::feed(Channel::Tcc0, Generator::Cpu);
        let mut tcc = tcc();
        tcc.write_ctrla(CtrlA::ZERO.with_swrst(true));
        while tcc.read_syncbusy().swrst() {}
        tcc.write_wave(Wave::ZERO.with_wavegen(Wavegen::Npwm));
        while tcc.read_syncbusy().wave() {}
        tcc.write_per(u32::from(PWM_PERIOD) - 1);
        while tcc.read_syncbusy().per() {}
        for channel in 0..4 {
            let _ = tcc.write_cc(channel, 0);
        }
        while tcc.read_syncbusy().raw_value() != 0 {}
        // On a fault every line in use is driven, and driven low.
        tcc.write_drvctrl(DrvCtrl::ZERO.with_nre0(true).with_nre1(true).with_nre6(true).with_nre7(true));
        tcc.write_dbgctrl(DbgCtrl::ZERO.with_fddbd(true));
        tcc.write_ctrla(CtrlA::ZERO.with_enable(true));
        while tcc.read_syncbusy().enable() {}
        for wire in PWM.into_iter().chain(BRAKE) {
            wire.pin.switch(wire.function);
        }
        Outputs { now: [Drive::Brake; 2] }
    }

    /// Drives \[left, right\]; in effect at the end of the period.
    #[inline]
    pub fn set(&mut self, drive: &[Drive; 2], calibration: &Calibration) {
        if self.now[0] != drive[0] {
            self.now[0] = drive[0];
            put(0, drive[0], calibration);
        }
        if self.now[1] != drive[1] {
            self.now[1] = drive[1];
            put(1, drive[1], calibration);
        }
    }
}

#[inline(never)]
fn put(side: usize, drive: Drive, calibration: &Calibration) {
    let mut tcc = tcc();
    let (duty, coil) = match calibration.command(drive) {
        Command::Brake => (0, 0),
        Command::Run { forward, duty } => {
            if let Some(wire) = DIRECTION.get(side) {
                wire.pin.set(forward);
            }
            (u32::from(duty), ALWAYS)
        }
    };
    // Both indices exist: two sides, four channels.
    let _ = tcc.write_ccbuf(side, duty);
    let _ = tcc.write_ccbuf(side + 2, coil);
}

/// Takes the lines from the timer and drives them low: brakes engaged, motors off. For panics and faults, and before
/// anything else at start.
pub fn brake_now() {
    for wire in BRAKE.into_iter().chain(PWM) {
        wire.pin.switch(Function::Output);
    }
}
