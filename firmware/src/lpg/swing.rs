//! LPG2 (hips) and LPG3 (abductors): one rule, used twice (paper, Fig. 2).
//!
//! At lift-off of the swing leg the target is computed **once** from where the trunk is falling:
//!
//! ```text
//! x = slow rate + C·lean                                            C: H2, V2
//! |x| ≤ dead band (H1, V1):  target 0
//! otherwise:                 sgn(x)·(a·x² + b·|x| + c), within reach    a: H3, V3   b: H4, V4
//! ```
//!
//! The leg moves there at constant speed (H5, V5) while its foot is in the air, and brakes on target, at touchdown or at
//! the end of the cycle. Meanwhile the other leg, which carries the robot, turns the opposite way by a fraction of what the
//! swing leg has to go: legs that open like scissors turn the trunk less, so the foot lands farther out. In a recovery cycle
//! the target is zero and the other leg stays.

use sarah_protocol::bus::{GaitEvent, Motion, Side};
use sarah_protocol::fixed::Q16;
use sarah_protocol::params::{Lpg, ParamSet};

use super::Drive;
use super::arithmetic::nearest;
use super::rules::SwingRules;

/// H1–H5 or V1–V5 in fixed point.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SwingParams {
    /// Dead band of |x|, rad/s.
    pub dead_band: Q16,
    /// Weight of lean, 1/s.
    pub lean_weight: Q16,
    /// Quadratic coefficient, rad s²/rad².
    pub quadratic: Q16,
    /// Linear coefficient, s.
    pub linear: Q16,
    /// Speed of the move, rad/s.
    pub speed: Q16,
}

impl SwingParams {
    /// The parameters of LPG2 or LPG3; for [`Lpg::Knee`] there are none.
    pub fn of(set: &ParamSet, lpg: Lpg) -> Option<SwingParams> {
        match set.values().get(lpg.range())? {
            &[dead_band, lean_weight, quadratic, linear, speed] => Some(SwingParams {
                dead_band: Q16::from_f32(dead_band),
                lean_weight: Q16::from_f32(lean_weight),
                quadratic: Q16::from_f32(quadratic),
                linear: Q16::from_f32(linear),
                speed: Q16::from_f32(speed),
            }),
            _ => None,
        }
    }
}

/// What LPG2 or LPG3 reads from the IMU: its own axis.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Sway {
    /// Lean rate, low-passed, rad/s.
    pub rate: Q16,
    /// Lean, rad.
    pub lean: Q16,
}

impl Sway {
    /// From a motion message; [`SwingRules::axis`] is 0 or 1.
    pub fn of(rules: &SwingRules, motion: &Motion) -> Sway {
        let along = |axes: &[Q16; 2]| axes.get(rules.axis).copied().unwrap_or_default();
        Sway { rate: along(&motion.slow_rate), lean: along(&motion.lean) }
    }
}

/// Where the move is.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
#[repr(u8)]
pub enum Phase {
    /// Waiting for a cycle.
    #[default]
    Idle = 0,
    /// A cycle runs, the foot has not lifted yet.
    Ready = 1,
    /// Moving.
    Moving = 2,
    /// In a cycle, braked: on target, or the foot is down.
    Held = 3,
}

/// State of LPG2 or LPG3.
#[derive(Clone, PartialEq, Debug)]
pub struct Swing {
    rules: SwingRules,
    phase: Phase,
    leg: Side,
    /// Decided at lift-off, or known when a recovery begins.
    target: Option<Q16>,
    /// Of the other leg, decided where the move begins.
    stance_target: Option<Q16>,
    /// The \[left, right\] leg has nowhere to go any more.
    arrived: [bool; 2],
    moving_us: u32,
}

impl Swing {
    /// At rest.
    pub const fn new(rules: SwingRules) -> Swing {
        Swing {
            rules,
            phase: Phase::Idle,
            leg: Side::Left,
            target: None,
            stance_target: None,
            arrived: [false; 2],
            moving_us: 0,
        }
    }

    /// Where the move is.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// The target of the current or last move, rad.
    pub fn target(&self) -> Option<Q16> {
        self.target
    }

    /// Ends the move where it is.
    pub fn abort(&mut self) {
        self.phase = Phase::Idle;
    }

    /// A flag of LPG1.
    pub fn on_gait(&mut self, event: GaitEvent, swing: Side, sway: &Sway, params: &SwingParams) {
        match (event, self.phase) {
            (GaitEvent::CycleStart | GaitEvent::Recovery, _) => {
                self.leg = swing;
                let recovers = event == GaitEvent::Recovery;
                self.target = recovers.then_some(Q16::ZERO);
                self.stance_target = None;
                self.arrived = Side::BOTH.map(|side| recovers && side != swing);
                self.moving_us = 0;
                self.phase = Phase::Ready;
            }
            (GaitEvent::LiftOff, Phase::Ready | Phase::Held) => {
                // A foot that bounces lifts again within the cycle: the move goes on, the decision stands.
                if self.target.is_none() {
                    self.target = Some(self.aim(sway, params));
                }
                self.phase = if self.arrived == [true; 2] { Phase::Held } else { Phase::Moving };
            }
            (GaitEvent::Touchdown, Phase::Moving) => self.phase = Phase::Held,
            (GaitEvent::CycleEnd, _) => self.phase = Phase::Idle,
            _ => {}
        }
    }

    /// One control tick: commands for the \[left, right\] joint and whether the move ran out of time.
    pub fn tick(&mut self, dt_us: u32, position: [Q16; 2], params: &SwingParams) -> ([Drive; 2], bool) {
        let mut drive = [Drive::Brake; 2];
        let mut timed_out = false;
        if let (Phase::Moving, Some(target)) = (self.phase, self.target) {
            let [left, right] = position;
            let (swing, stance) = if self.leg == Side::Left { (left, right) } else { (right, left) };
            let stance_target =
                *self.stance_target.get_or_insert_with(|| stance - self.rules.scissor.times(target - swing));
            self.moving_us = self.moving_us.saturating_add(dt_us);
            timed_out = self.moving_us > self.rules.move_us;
            let (move_swing, move_stance) = ((target, params.speed), (stance_target, self.rules.scissor_speed));
            let moves = if self.leg == Side::Left { [move_swing, move_stance] } else { [move_stance, move_swing] };
            for (((drive, arrived), at), (target, speed)) in
                drive.iter_mut().zip(&mut self.arrived).zip(position).zip(moves)
            {
                let error = target - at;
                // Nearer than half a tick's travel is as near as this tick rate gets.
                *arrived |= timed_out || nearest(error.abs().0 as u32, speed.0 as u32, dt_us);
                if !*arrived {
                    *drive = Drive::Velocity(speed.signed(error.signum()));
                }
            }
            if self.arrived == [true; 2] {
                self.phase = Phase::Held;
            }
        }
        (drive, timed_out)
    }

    fn aim(&self, sway: &Sway, params: &SwingParams) -> Q16 {
        let rules = &self.rules;
        let x = sway.rate + params.lean_weight.times(sway.lean);
        if x.abs() <= params.dead_band {
            return Q16::ZERO;
        }
        let size = x.abs();
        let reach = params.quadratic.times(size.times(size)) + params.linear.times(size) + rules.constant;
        if !rules.outward_only {
            return reach.max(-rules.reach).min(rules.reach).signed(x.signum());
        }
        let outward = self.leg.sign();
        let with_fall = x.signum() == outward;
        let angle = if with_fall { reach } else { rules.opposite.times(size) };
        angle.max(Q16::ZERO).min(rules.reach).signed(outward)
    }
}
