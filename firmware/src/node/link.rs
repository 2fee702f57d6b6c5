//! What every node does alike: mode and halt, freshness, parameters, end stops, status.

use sarah_protocol::bus::{Message, Mode, Motion, NodeId, Staged, Status, limits};
use sarah_protocol::fixed::Q16;
use sarah_protocol::newer;
use sarah_protocol::params::{ParamError, ParamSet};

use super::Sensors;
use super::heard::Heard;
use super::reckoning::Place;
use crate::lpg::Drive;

/// IMU products older than this are no basis for motion: five samples at the slowest IMU rate.
pub const MOTION_TIMEOUT_US: u32 = 50_000;
/// Between two status messages.
pub const STATUS_PERIOD_US: u32 = 10_000;
/// What a hip or an abductor loses while its leg gathers speed: half of 10 ms.
pub const SWING_GATHER_US: u32 = 5_000;
/// What a node goes by until it hears of the trunk: it hangs still.
pub const UNHEARD: Motion = Motion {
    sequence: 0,
    mode: Mode::Braked,
    acceleration: Q16::lit(9.81),
    rotation: Q16::ZERO,
    rate: [Q16::ZERO; 2],
    slow_rate: [Q16::ZERO; 2],
    lean: [Q16::ZERO; 2],
};

/// What a node is born with.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct NodeConfig {
    /// Generation 0: the set built into the image.
    pub default: ParamSet,
    /// Tells a restart from a silence; drawn anew at every boot.
    pub boot_nonce: u16,
    /// Joints brake before they pass ± this, m or rad.
    pub end_stop: Q16,
    /// Positions beyond ± this cannot be: the last good one is used.
    pub plausible: Q16,
}

/// Shared state of a node with parameters `P`.
#[derive(Clone, PartialEq, Debug)]
pub struct NodeLink<P> {
    /// Newest plausible positions.
    good: [Q16; 2],
    places: [Place; 2],
    plausible: Q16,
    motion_age_us: u32,
    since_status_us: u32,
    /// Reasons of this tick.
    limits: u16,
    /// Reasons since the last status message.
    reported: u16,
    mode: Mode,
    halted: bool,
    id: NodeId,
    boot_nonce: u16,
    end_stop: Q16,
    applied: (u32, P),
    staged: Option<(u32, P)>,
}

impl<P: Copy> NodeLink<P> {
    /// Braked, with the built-in set, having heard nothing.
    pub const fn new(id: NodeId, config: &NodeConfig, params: P) -> NodeLink<P> {
        NodeLink {
            id,
            boot_nonce: config.boot_nonce,
            end_stop: config.end_stop,
            plausible: config.plausible,
            mode: Mode::Braked,
            halted: false,
            motion_age_us: u32::MAX,
            applied: (0, params),
            staged: None,
            since_status_us: STATUS_PERIOD_US,
            good: [Q16::ZERO; 2],
            places: [Place::resting(), Place::resting()],
            limits: 0,
            reported: 0,
        }
    }

    /// Which node this is.
    pub fn id(&self) -> NodeId {
        self.id
    }

    /// Generation in force.
    pub fn generation(&self) -> u32 {
        self.applied.0
    }

    /// Parameters in force.
    pub fn params(&self) -> &P {
        &self.applied.1
    }

    /// Generation staged.
    pub fn staged(&self) -> Option<u32> {
        self.staged.as_ref().map(|(generation, _)| *generation)
    }

    /// Where the joints are in this tick, see [`super::reckoning`].
    pub fn position(&self) -> [Q16; 2] {
        let [left, right] = &self.places;
        [left.at(), right.at()]
    }

    /// Newest plausible positions, as the sensors have them.
    pub fn sensed(&self) -> [Q16; 2] {
        self.good
    }

    /// Brakes are due at once: never armed, disarmed, or halted.
    pub fn must_brake(&self) -> bool {
        self.halted || self.mode == Mode::Braked
    }

    /// IMU products are fresh: a new cycle may start.
    pub fn fresh(&self) -> bool {
        self.motion_age_us <= MOTION_TIMEOUT_US
    }

    /// Adds a reason, one of [`limits`].
    pub fn limit(&mut self, reason: u16) {
        self.limits |= reason;
    }

    /// A motion message came.
    pub fn moved(&mut self, mode: Mode) {
        // The halt is unlatched only by motion messages that say braked: an armed one that was already under way when the
        // halt went out must not release it.
        if mode == Mode::Braked {
            self.halted = false;
        }
        self.mode = mode;
        self.motion_age_us = 0;
    }

    /// The part of the bus traffic all nodes treat alike.
    #[inline(never)]
    pub fn take_in<M>(&mut self, heard: &Heard<M, P>, say: &mut impl FnMut(Message)) {
        match heard {
            Heard::Halt => self.halted = true,
            Heard::Motion(mode, _) => self.moved(*mode),
            Heard::Stage(generation, set) => {
                if let Some(result) = self.stage(*generation, set) {
                    say(Message::Staged(self.id, Staged { generation: *generation, result }));
                }
            }
            Heard::Gait(_) | Heard::Activate(_) | Heard::Other => {}
        }
    }

    /// What to answer to a set, if anything.
    fn stage(&mut self, generation: u32, set: &Result<P, ParamError>) -> Option<Result<(), ParamError>> {
        // What is in force stays in force: a late copy of it is acknowledged, anything older is ignored.
        if generation == self.applied.0 {
            return Some(Ok(()));
        }
        if !newer(generation, self.applied.0) {
            return None;
        }
        Some(match set {
            Ok(params) => {
                self.staged = Some((generation, *params));
                Ok(())
            }
            Err(error) => Err(*error),
        })
    }

    /// Puts the staged set into force if it is `generation`. Call only between cycles.
    pub fn swap_to(&mut self, generation: u32) -> bool {
        if self.applied.0 == generation {
            return true;
        }
        match self.staged {
            Some((held, set)) if held == generation => {
                self.applied = (held, set);
                self.staged = None;
                true
            }
            _ => false,
        }
    }

    /// Start of a tick: ages, and the positions with implausible ones replaced.
    pub fn begin(&mut self, dt_us: u32, sensors: &Sensors) {
        self.motion_age_us = self.motion_age_us.saturating_add(dt_us);
        self.since_status_us = self.since_status_us.saturating_add(dt_us);
        let mut limits = 0;
        let [left, right] = sensors.position;
        let gather_us = if matches!(self.id, NodeId::Knee) { 0 } else { SWING_GATHER_US };
        let ([left_place, right_place], [left_good, right_good]) = (&mut self.places, &mut self.good);
        let plausible = sense(left_place, left_good, left, self.plausible);
        if !(sense(right_place, right_good, right, self.plausible) & plausible) {
            limits |= limits::SENSOR;
        }
        left_place.advance(dt_us, gather_us);
        right_place.advance(dt_us, gather_us);
        if self.mode == Mode::Braked {
            limits |= limits::BRAKED;
        }
        if self.halted {
            limits |= limits::HALTED;
        }
        if !self.fresh() {
            limits |= limits::COORDINATOR_LOST;
        }
        self.limits = limits;
    }

    /// End of the decision: brakes what would pass the end of its range, and remembers what the joints are told.
    pub fn stop_at_ends(&mut self, drive: &mut [Drive; 2]) {
        let ([left, right], [left_place, right_place]) = (drive, &mut self.places);
        let [left_good, right_good] = self.good;
        let stopped = stop_at_end(left, left_place.at(), left_good, self.end_stop);
        if stop_at_end(right, right_place.at(), right_good, self.end_stop) | stopped {
            self.limits |= limits::END_STOP;
        }
        left_place.told(*left);
        right_place.told(*right);
    }

    /// End of a tick: whether it is time for [`NodeLink::status`].
    pub fn status_is_due(&mut self) -> bool {
        self.reported |= self.limits;
        self.since_status_us >= STATUS_PERIOD_US
    }

    /// The status message, with the reasons since the last one.
    pub fn status(&mut self, sensors: &Sensors, view: View) -> Message {
        self.since_status_us = 0;
        let limits = core::mem::take(&mut self.reported);
        Message::Status(
            self.id,
            Status {
                position: self.good,
                loads: sensors.load.map(decinewtons),
                phase: view.phase,
                factor: view.factor,
                steps: view.steps,
                cycle: view.cycle,
                applied: self.applied.0,
                staged: self.staged(),
                limits,
                boot_nonce: self.boot_nonce,
            },
        )
    }
}

/// What a generator shows in its status.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct View {
    /// Phase; 0 is idle.
    pub phase: u8,
    /// Factor, knee only.
    pub factor: Q16,
    /// Steps, knee only.
    pub steps: u32,
    /// Cycle number.
    pub cycle: u32,
}

/// Takes in what a sensor says, if it can be; whether it can.
#[inline(always)]
fn sense(place: &mut Place, good: &mut Q16, sensed: Q16, most: Q16) -> bool {
    let most = most.0 as u32;
    // −most ≤ position ≤ most, both in one comparison.
    let plausible = (sensed.0 as u32).wrapping_add(most) <= 2 * most;
    if plausible {
        *good = sensed;
        place.sense(sensed);
    }
    plausible
}

/// Brakes what would pass the end of its range; whether it would.
#[inline(always)]
fn stop_at_end(drive: &mut Drive, reckoned: Q16, sensed: Q16, end: Q16) -> bool {
    let Drive::Velocity(speed) = *drive else { return false };
    // A late sensor has not seen it there yet, a joint that stalled before may be there unreckoned: either is enough.
    let stops = if speed > Q16::ZERO { reckoned.max(sensed) >= end } else { reckoned.min(sensed) <= -end };
    if stops {
        *drive = Drive::Brake;
    }
    stops
}

fn decinewtons(force: Q16) -> u16 {
    // Newtons and their fraction apart: 32 bits do.
    let force = force.0.max(0) as u32;
    ((force >> 16) * 10 + (((force & 0xffff) * 10) >> 16)).min(u16::MAX.into()) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    proptest::proptest! {
        #[test]
        fn decinewtons_are_tenths_rounded_down(force: i32, shift in 0..32) {
            for force in [force, force >> shift] {
                let exact = (i64::from(force.max(0)) * 10 / 65_536).min(65_535);
                proptest::prop_assert_eq!(i64::from(decinewtons(Q16(force))), exact);
            }
        }
    }

    /// A hip's link, with a sensor that says `sensed`, told `drive` until it brakes or 100 ms have passed.
    fn moved(sensed: impl Fn(f64) -> f64) -> (NodeLink<()>, Drive) {
        let config = NodeConfig {
            default: ParamSet::table_ii(),
            boot_nonce: 1,
            end_stop: Q16::lit(0.3),
            plausible: Q16::lit(0.7),
        };
        let mut link = NodeLink::new(NodeId::Hip, &config, ());
        let mut last = Drive::Brake;
        for tick in 0..100 {
            let at = (f64::from(tick) * 0.005 - 0.025).max(0.0);
            let sensors = Sensors { position: [Q16::lit(sensed(at)), Q16::ZERO], load: [Q16::ZERO; 4] };
            link.begin(1_000, &sensors);
            let mut drive = [Drive::Velocity(Q16::lit(5.0)), Drive::Brake];
            link.stop_at_ends(&mut drive);
            last = drive[0];
            if last == Drive::Brake {
                break;
            }
        }
        (link, last)
    }

    #[test]
    fn the_end_of_a_range_brakes_whoever_sees_it_first_reckoning_or_sensor() {
        for sensed in [|_| 0.0, |at| at, |at| 2.0 * at] {
            let (link, last) = moved(sensed);
            assert_eq!(last, Drive::Brake);
            assert_ne!(link.limits & limits::END_STOP, 0);
            assert!(link.position()[0] < Q16::lit(0.31), "{:?}", link.position());
        }
    }

    #[test]
    fn a_joint_whose_sensor_is_lost_stays_where_it_is_reckoned() {
        let (mut link, _) = moved(|at| if at > 0.1 { 9.0 } else { at });
        let reckoned = link.position()[0];
        assert!(reckoned > Q16::lit(0.29));
        for _ in 0..300 {
            link.begin(1_000, &Sensors { position: [Q16::lit(9.0), Q16::ZERO], load: [Q16::ZERO; 4] });
            link.stop_at_ends(&mut [Drive::Brake; 2]);
        }
        assert_eq!(link.position()[0], reckoned);
        assert_ne!(link.limits & limits::SENSOR, 0);
    }
}
