//! LPG1 with ideal actuators, for tests.

use sarah_firmware::lpg::Drive;
use sarah_firmware::lpg::factor::PlainDivider;
use sarah_firmware::lpg::fall::Fall;
use sarah_firmware::lpg::knee::{Knee, KneeInputs, KneeOutputs, KneeParams, Phase};
use sarah_firmware::lpg::rules::KNEE;
use sarah_protocol::bus::{GaitEvent, Motion};
use sarah_protocol::fixed::Q16;

pub const RATES: [u32; 3] = [10_000, 1_000, 100];
pub const LOADED: Q16 = Q16::lit(150.0);
pub const AIR: Q16 = Q16::ZERO;

pub fn params() -> KneeParams {
    KneeParams { kick: Q16::lit(0.09), retract: Q16::lit(0.8), extend: Q16::lit(0.9) }
}

/// The trunk turns at `rotation` and leans `[sagittal, lateral]`.
pub fn motion(rotation: f64, lean: [f64; 2]) -> Motion {
    Motion { acceleration: Q16::lit(9.81), rotation: Q16::lit(rotation), lean: lean.map(Q16::lit), ..Motion::default() }
}

pub const PUSHED: fn() -> Motion = || motion(1.0, [0.0, 0.15]);
/// Factor is high, and the feet hold the robot.
pub const HELD: fn() -> Motion = || motion(1.0, [0.0, 0.02]);
pub const QUIET: fn() -> Motion = || motion(0.0, [0.0, 0.0]);

/// LPG1 with ideal actuators; feet unload when shorter than −5 mm.
pub struct Rig {
    pub knee: Knee,
    pub dt_us: u32,
    pub position: [f64; 2],
    /// What the sensors say, if not the position.
    pub sensed: Option<[f64; 2]>,
    pub load: [Q16; 2],
    pub motion: Motion,
    pub may_start: bool,
}

impl Rig {
    /// Standing.
    pub fn new(dt_us: u32) -> Rig {
        let mut rig = Rig::set_down(dt_us);
        for _ in 0..KNEE.stand_us.div_ceil(dt_us) {
            rig.tick();
        }
        rig
    }

    /// Armed just now.
    pub fn set_down(dt_us: u32) -> Rig {
        Rig {
            knee: Knee::idle(),
            dt_us,
            position: [0.0; 2],
            sensed: None,
            load: [LOADED; 2],
            motion: QUIET(),
            may_start: true,
        }
    }

    pub fn tick(&mut self) -> KneeOutputs {
        let inputs = KneeInputs {
            dt_us: self.dt_us,
            load: self.load,
            position: self.position.map(Q16::lit),
            sensed: self.sensed.unwrap_or(self.position).map(Q16::lit),
            fall: &Fall::of(&PlainDivider, &self.motion),
            may_start: self.may_start,
        };
        let out = self.knee.tick(&inputs, &params());
        for (position, drive) in self.position.iter_mut().zip(out.drive) {
            if let Drive::Velocity(v) = drive {
                *position += v.to_f32() as f64 * self.dt_us as f64 * 1e-6;
            }
        }
        out
    }

    /// Makes a whole cycle: falls until its foot is to be lifted, then stands quietly.
    pub fn cycle(&mut self) {
        self.motion = PUSHED();
        self.run(|r| r.knee.phase() == Phase::Retract);
        self.motion = QUIET();
        self.run(|r| r.knee.phase() == Phase::Idle);
        // The foot lands.
        self.tick();
    }

    /// Ticks until `stop` or two seconds; all events on the way, with the time of each in seconds.
    pub fn run(&mut self, stop: impl Fn(&Rig) -> bool) -> Vec<(GaitEvent, f64)> {
        let mut events = vec![];
        for tick in 0..2_000_000 / self.dt_us {
            let seconds = tick as f64 * self.dt_us as f64 * 1e-6;
            events.extend(self.tick().events.iter().map(|e| (*e, seconds)));
            if stop(self) {
                break;
            }
        }
        events
    }
}

pub fn names(events: &[(GaitEvent, f64)]) -> Vec<GaitEvent> {
    events.iter().map(|e| e.0).collect()
}
