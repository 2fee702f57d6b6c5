//! LPG1: the linear actuators (paper, Fig. 3). It owns the cycle and raises the flags the other two follow.
//!
//! ```text
//!          both feet loaded*, Factor > 0.07, rested         kick height or time
//!   Idle ──────────────────────────────────────────▶ Kick ─────────────────────▶ Retract
//!   ▲ │   one foot loaded, ξ high                   (CycleStart or Recovery)        │ −Step
//!   │ │   calm, a leg away from rest                                                ▼
//!   │ └── calm, a leg short of rest (Recovery) ──────────────────────────────────▶ Extend
//!   └──────────────── at rest height, or loaded again and still falling ─────────────┘
//!      (CycleEnd)                        (LiftOff when the foot unloads or has been pulled up, Touchdown when it loads)
//! ```
//! * or one that has just landed, if the fall is sagittal.
//!
//! Every state has a time-out; at most one step is counted per cycle. Legs stay where a step put them, until they come home
//! (`recovery.rs`).

use heapless::Vec;
use sarah_protocol::bus::{GaitEvent, Side};
use sarah_protocol::fixed::Q16;
use sarah_protocol::params::ParamSet;

use super::Drive;
use super::arithmetic::covers;
use super::fall::Fall;
use super::recovery::Recovery;
use super::rules::KNEE;

/// P1–P3 in fixed point.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct KneeParams {
    /// P1, m/s.
    pub kick: Q16,
    /// P2, m/s.
    pub retract: Q16,
    /// P3, m/s.
    pub extend: Q16,
}

impl From<&ParamSet> for KneeParams {
    fn from(set: &ParamSet) -> Self {
        let [p1, p2, p3, ..] = *set.values();
        KneeParams { kick: Q16::from_f32(p1), retract: Q16::from_f32(p2), extend: Q16::from_f32(p3) }
    }
}

/// Where the cycle is.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
#[repr(u8)]
pub enum Phase {
    /// At rest, braked.
    #[default]
    Idle = 0,
    /// Extending a little to shift the weight onto the other leg.
    Kick = 1,
    /// Lifting the foot.
    Retract = 2,
    /// Bringing it back down.
    Extend = 3,
}

/// What one tick sees.
#[derive(Clone, Copy, Debug)]
pub struct KneeInputs<'a> {
    /// Since the last tick.
    pub dt_us: u32,
    /// Contact force under \[left, right\] foot, N.
    pub load: [Q16; 2],
    /// Stroke \[left, right\], m, extension positive, 0 at rest.
    pub position: [Q16; 2],
    /// The same as the sensors have it, however late.
    pub sensed: [Q16; 2],
    /// Newest IMU products.
    pub fall: &'a Fall,
    /// Whether a new cycle may start: the robot is armed and the IMU is heard.
    pub may_start: bool,
}

/// What one tick decides.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct KneeOutputs {
    /// Command for the \[left, right\] actuator.
    pub drive: [Drive; 2],
    /// Flags raised, in order.
    pub events: Vec<GaitEvent, 4>,
    /// A state ran into its time-out in this tick.
    pub timed_out: bool,
}

/// State of LPG1.
#[derive(Clone, PartialEq, Debug)]
pub struct Knee {
    phase: Phase,
    swing: Side,
    /// Since the current phase began; saturates.
    phase_us: u32,
    /// Step height of this cycle, m.
    step: Q16,
    /// Where its kick ends, m.
    kick_height: Q16,
    /// The swing foot was unloaded at some time of this cycle.
    lifted: bool,
    /// The swing foot is in the air now.
    airborne: bool,
    counted: bool,
    stepped_before: bool,
    steps: u32,
    cycle: u32,
    recovery: Recovery,
    /// Stroke below which the swing foot has left the ground.
    lifted_at: Q16,
    /// Since the swing leg was pulled up, until the pads told of it: as late, or later, they will tell of touchdown.
    late_us: u32,
    /// They have told of it in this cycle, or need not, as the leg grows where it stands.
    unloaded: bool,
    /// For so long the leg has waited at rest height for what the pads will say.
    waited_us: u32,
    /// The robot has stood still since it may move, or has been let off it.
    stood: bool,
    /// For so long it may move, and for so long it has stood still meanwhile.
    standing_us: (u32, u32),
}

impl Knee {
    /// At rest.
    pub const fn idle() -> Knee {
        Knee {
            phase: Phase::Idle,
            swing: Side::Left,
            phase_us: u32::MAX,
            step: Q16::ZERO,
            kick_height: Q16::ZERO,
            lifted: false,
            airborne: false,
            counted: false,
            stepped_before: false,
            steps: 0,
            cycle: 0,
            recovery: Recovery::home(),
            lifted_at: Q16::ZERO,
            late_us: 0,
            unloaded: false,
            waited_us: 0,
            stood: false,
            standing_us: (0, 0),
        }
    }

    /// Where the cycle is.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// The swing leg of the current or last cycle.
    pub fn swing(&self) -> Side {
        self.swing
    }

    /// Steps since boot; wraps.
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// Cycles since boot; wraps.
    pub fn cycle(&self) -> u32 {
        self.cycle
    }

    /// Ends the cycle where it is: the robot may not move. True if one was running.
    pub fn abort(&mut self) -> bool {
        self.stood = false;
        self.standing_us = (0, 0);
        let running = self.phase != Phase::Idle;
        if running {
            self.enter(Phase::Idle);
        }
        self.airborne = false;
        running
    }

    /// One control tick.
    pub fn tick(&mut self, inputs: &KneeInputs, params: &KneeParams) -> KneeOutputs {
        let mut out = KneeOutputs::default();
        self.phase_us = self.phase_us.saturating_add(inputs.dt_us);
        let [left, right] = inputs.load;
        let loaded = [left > KNEE.loaded_n, right > KNEE.loaded_n];

        if self.phase == Phase::Idle {
            self.recovery.watch(inputs.fall.calm & inputs.may_start & loaded[0] & loaded[1], inputs.dt_us);
            if !self.stood & inputs.may_start {
                self.stand(loaded, inputs);
            }
            let start = if inputs.may_start & self.stood { self.start(loaded, inputs) } else { None };
            let Some((swing, kind)) = start else {
                // A foot that was still in the air when its leg came to rest lands now.
                if self.airborne && loaded[self.swing as usize] {
                    self.flags(true, true, &mut out);
                }
                return out;
            };
            self.begin(swing, kind == GaitEvent::Recovery, inputs);
            raise(&mut out, kind);
        }
        let leg = self.swing as usize;
        out.drive[leg] = self.stroke(loaded[leg], inputs.position[leg], inputs, params, &mut out);
        out
    }

    /// A robot that was just set down rocks on its soles: a step would make a march of it.
    fn stand(&mut self, loaded: [bool; 2], inputs: &KneeInputs) {
        let (all, still) = self.standing_us;
        let still_now = inputs.fall.calm & loaded[0] & loaded[1];
        let still = if still_now { still.saturating_add(inputs.dt_us) } else { 0 };
        self.standing_us = (all.saturating_add(inputs.dt_us), still);
        self.stood = still >= KNEE.stand_us || all >= KNEE.stand_at_most_us;
    }

    /// A cycle begins. Not part of every tick, so it stays in flash.
    #[inline(never)]
    fn begin(&mut self, swing: Side, recovers: bool, inputs: &KneeInputs) {
        self.swing = swing;
        self.step = match recovers {
            // From where the leg is: a short leg that is not lifted would push the robot up.
            true => KNEE.recovery_step - inputs.position[swing as usize].min(Q16::ZERO),
            false => inputs.fall.step,
        };
        self.kick_height = KNEE.kick_fraction.times(self.step);
        self.lifted_at = inputs.position[swing as usize] - KNEE.lift;
        match recovers {
            true => self.recovery.begin(swing, inputs.position[swing as usize]),
            false => self.recovery.step(self.phase_us),
        }
        (self.lifted, self.airborne) = (false, false);
        (self.late_us, self.waited_us) = (0, 0);
        // A leg that is not pulled up needs no word of its pads before they are believed.
        self.unloaded = self.recovery.straightens();
        // A recovery tidies up; it is no step.
        self.counted = recovers;
        self.stepped_before = true;
        self.cycle = self.cycle.wrapping_add(1);
        self.enter(if self.recovery.straightens() { Phase::Extend } else { Phase::Kick });
    }

    /// A tick within a cycle: what drives the swing leg, whose foot is `grounded`. A state that ends here hands over to
    /// the next at once.
    fn stroke(
        &mut self,
        grounded: bool,
        position: Q16,
        inputs: &KneeInputs,
        params: &KneeParams,
        out: &mut KneeOutputs,
    ) -> Drive {
        if self.phase == Phase::Kick {
            if position < self.kick_height && !self.passed(KNEE.kick_us, inputs.dt_us) {
                return Drive::Velocity(params.kick);
            }
            let [left, right] = inputs.load;
            let other = if self.swing == Side::Left { right } else { left };
            if grounded && other <= KNEE.loaded_n && !inputs.fall.lifts {
                return self.end(out);
            }
            self.enter(Phase::Retract);
        }
        let grounded = self.carries(grounded, position, inputs.dt_us);
        if self.phase == Phase::Retract {
            let late = self.passed(KNEE.stroke_us, inputs.dt_us);
            if position > -self.step && !late {
                self.flags(grounded, false, out);
                return Drive::Velocity(-params.retract);
            }
            out.timed_out |= late;
            self.enter(Phase::Extend);
        }
        let landed = grounded && self.lifted;
        if landed {
            self.recovery.land(self.swing, position);
        }
        let (speed, limit_us) = match self.recovery.straightens() {
            true => (KNEE.straighten, KNEE.straighten_at_most_us),
            false if grounded => (KNEE.touchdown_speed.min(params.extend), KNEE.stroke_us),
            false => (params.extend, KNEE.stroke_us),
        };
        let late = self.passed(limit_us, inputs.dt_us);
        let down = grounded || self.late_us > KNEE.late_us && position >= -KNEE.near;
        self.flags(down, true, out);
        // What a silent IMU said last is no reason to reach.
        let reaches = inputs.may_start && self.reaches(grounded, inputs.fall);
        let waits = !self.unloaded | (self.waited_us < self.late_us);
        if reaches && position >= Q16::ZERO && waits && self.waited_us < KNEE.wait_us {
            // The foot may be down already, and the pads as late to tell as they were at lift-off.
            self.waited_us = self.waited_us.saturating_add(inputs.dt_us);
            return Drive::Brake;
        }
        // Pads that have told nothing at all are no reason to reach for the ground.
        let goal = if reaches && self.unloaded { KNEE.reach } else { Q16::ZERO };
        let near = covers(speed, KNEE.lead_us, goal - position - KNEE.lead_margin);
        // A leg that did not follow its retraction is longer than reckoned. Its sensor says so, and being late makes no leg
        // longer than it was.
        let beyond = inputs.sensed[self.swing as usize] > goal + KNEE.beyond;
        if late || near || beyond || landed && inputs.fall.falls {
            out.timed_out |= late | beyond;
            return self.end(out);
        }
        Drive::Velocity(speed)
    }

    /// Whether the swing foot carries load. One that is pulled up farther than the pads give has left the ground, though
    /// they tell it later.
    fn carries(&mut self, grounded: bool, position: Q16, dt_us: u32) -> bool {
        if self.unloaded {
            return grounded;
        }
        self.unloaded = !grounded;
        let up = self.lifted || position <= self.lifted_at;
        if grounded {
            self.late_us = self.late_us.saturating_add(dt_us);
        }
        grounded && !up
    }

    /// The cycle is over.
    fn end(&mut self, out: &mut KneeOutputs) -> Drive {
        self.enter(Phase::Idle);
        raise(out, GaitEvent::CycleEnd);
        Drive::Brake
    }

    /// Whether the leg may grow longer than at rest to find the ground.
    fn reaches(&self, grounded: bool, fall: &Fall) -> bool {
        self.lifted && !grounded && fall.falls && !self.recovery.runs()
    }

    /// The leg to swing if a cycle starts now, and what for.
    fn start(&self, loaded: [bool; 2], inputs: &KneeInputs) -> Option<(Side, GaitEvent)> {
        let fall = inputs.fall;
        let mut stands = loaded;
        // A robot that rocks on its heels or toes lifts a foot again by the millimetres that its leg is short of rest. The
        // foot is there to fall on, so the other may step; in a chain it would be the turn of the foot that just stepped.
        if fall.sagittal && self.lifted && !self.airborne && self.phase_us < KNEE.chain_dwell_us {
            stands[self.swing as usize] = true;
        }
        match stands {
            [true, true] if fall.starts && self.phase_us >= KNEE.dwell_us => {
                let fresh = !self.stepped_before || self.phase_us > KNEE.fresh_us;
                let swing = match (fresh, fall.left) {
                    (false, _) => self.swing.other(),
                    (true, true) => Side::Left,
                    (true, false) => Side::Right,
                };
                Some((swing, GaitEvent::CycleStart))
            }
            [true, true] => self.recovery.due(inputs.position).map(|side| (side, GaitEvent::Recovery)),
            [true, false] => self.start_on(Side::Left, fall),
            [false, true] => self.start_on(Side::Right, fall),
            [false, false] => None,
        }
    }

    /// The same while one foot carries alone.
    fn start_on(&self, carries: Side, fall: &Fall) -> Option<(Side, GaitEvent)> {
        let outward = fall.left == (carries == Side::Left) && !fall.sagittal;
        let (swing, starts) = match outward {
            // A chain: the foot in the air is where the fall goes.
            false => (carries.other(), fall.chains && self.phase_us >= KNEE.chain_dwell_us),
            // Over the outer edge of the foot that carries. The other cannot get there, so the robot hops.
            true => (carries, fall.starts && fall.lifts && self.phase_us >= KNEE.dwell_us),
        };
        starts.then_some((swing, GaitEvent::CycleStart))
    }

    /// Follows the swing foot's load, raises the flags, counts the step.
    fn flags(&mut self, grounded: bool, may_count: bool, out: &mut KneeOutputs) {
        if !grounded && !self.airborne {
            self.airborne = true;
            self.lifted = true;
            raise(out, GaitEvent::LiftOff);
        } else if grounded && self.airborne {
            self.airborne = false;
            raise(out, GaitEvent::Touchdown);
        }
        // A foot that the pads never saw in the air has made no step.
        if grounded && self.lifted && self.unloaded && may_count && !self.counted {
            self.counted = true;
            self.steps = self.steps.wrapping_add(1);
        }
    }

    fn enter(&mut self, phase: Phase) {
        self.phase = phase;
        self.phase_us = 0;
    }

    /// Whether this tick is the nearest to `limit` since the phase began.
    fn passed(&self, limit_us: u32, dt_us: u32) -> bool {
        self.phase_us.saturating_add(dt_us / 2) >= limit_us
    }
}

/// Four events are the most a tick can raise (start, lift-off, touchdown, end), so the push cannot fail.
fn raise(out: &mut KneeOutputs, event: GaitEvent) {
    let _ = out.events.push(event);
}
