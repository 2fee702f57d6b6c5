//! Controllers on common episodes: the same pushes, the same sensor noise, nothing learned on the way.

use std::num::NonZero;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use sarah_protocol::params::ParamSet;
use sarah_protocol::telemetry::Telemetry;
use sarah_sim::energy::{BATTERY_J, EnergyConfig};
use sarah_sim::robot::{Geometry, Health, Joint};
use sarah_sim::scenario::{Episode, Scenario};
use sarah_sim::sil::{SilConfig, SilError};
use thiserror::Error;

use crate::enaf::trainer::episode_seed;
use crate::enaf::{EnafError, Policy};
use crate::figures::Pose as DrawnPose;
use crate::link::sim::{LinkError, SLICE_US, SimRobot, Slice};
use crate::metrics::{Autonomy, EnergyJ, EpisodeResult, Outcome, Trace, TraceSample};
use crate::task::action::{self, Scope};
use crate::task::environment::DECISION_S;
use crate::task::judge::Judge;
use crate::task::observation::{acceleration_m_s2, loads_n, observe, rate_rad_s};
use crate::task::odometry::Odometry;
use crate::task::odometry::audit::{Audit, Audited, FALL_WITHIN_S};
use crate::task::reward::RewardForm;
use crate::task::robots::{DrawError, Robots};

/// Who balances.
#[derive(Clone, Debug)]
pub enum Controller {
    /// Nobody: the brakes stay on.
    Braked,
    /// The pattern generators with a constant set.
    Constants(ParamSet),
    /// The pattern generators with two constant sets, chosen once a second: the least that can depend on the state.
    TwoSets {
        /// After a second without a cycle.
        resting: ParamSet,
        /// After a second with one.
        stepping: ParamSet,
    },
    /// The pattern generators, with an agent that moves some of their parameters once a second.
    Policy {
        /// The agent.
        policy: Box<Policy>,
        /// Everything it does not move.
        base: ParamSet,
        /// What it moves.
        scope: Scope,
    },
}

impl Controller {
    /// The set that it begins with; none if nothing may move.
    fn first(&self) -> Option<ParamSet> {
        match self {
            Controller::Braked => None,
            Controller::Constants(set) | Controller::TwoSets { resting: set, .. } => Some(*set),
            Controller::Policy { base, .. } => Some(*base),
        }
    }

    /// The set for the next second, from the telemetry of the last; none where there is nothing to choose.
    fn choose(&mut self, second: &[Telemetry]) -> Result<Option<ParamSet>, EnafError> {
        Ok(match self {
            Controller::Braked | Controller::Constants(_) => None,
            Controller::TwoSets { resting, stepping } => {
                let stepped = second.iter().any(|frame| frame.phases[0] != 0);
                Some(if stepped { *stepping } else { *resting })
            }
            Controller::Policy { policy, base, scope } => {
                let chosen = policy.act(&observe(second))?;
                Some(action::decode(base, *scope, &chosen))
            }
        })
    }
}

/// Why an episode could not be evaluated.
#[derive(Debug, Error)]
pub enum EvaluateError {
    /// The link or the simulation.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The agent.
    #[error(transparent)]
    Agent(#[from] EnafError),
    /// The robots.
    #[error(transparent)]
    Draw(#[from] DrawError),
}

/// An episode with everything a figure needs.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    /// Sample by sample, one per telemetry frame.
    pub trace: Trace,
    /// The robot's pose at the same times.
    pub poses: Vec<DrawnPose>,
}

/// What is noted of an episode beside its result.
#[derive(Debug)]
pub enum Watch<'a> {
    /// Nothing.
    Nothing,
    /// Everything a figure needs.
    Recording(&'a mut Recording),
    /// How far odometry was from the truth.
    Odometry(&'a mut Audited),
}

/// Odometry beside an episode. No controller knows of it.
struct Auditor {
    odometry: Odometry,
    audit: Audit,
}

impl Auditor {
    fn new() -> Result<Auditor, EvaluateError> {
        let geometry = Geometry::load().map_err(SilError::from).map_err(LinkError::from)?;
        Ok(Auditor { odometry: Odometry::new(geometry), audit: Audit::default() })
    }

    fn saw(&mut self, robot: &SimRobot, health: Health, telemetry: &[Telemetry]) {
        telemetry.iter().for_each(|frame| _ = self.odometry.saw(frame));
        let fallen = matches!(health, Health::Fallen { .. });
        self.audit.saw(robot.now_s(), &robot.pose(), fallen, &self.odometry.estimate());
    }

    /// The episode is over; a robot that fell lies there until odometry has had the time to tell.
    fn finish(mut self, robot: &mut SimRobot, health: Health) -> Result<Audited, EvaluateError> {
        if let Health::Fallen { .. } = health {
            let until_s = robot.now_s() + FALL_WITHIN_S;
            robot.world_mut().run_on();
            while robot.now_s() < until_s {
                let telemetry = robot.advance()?.telemetry;
                self.saw(robot, health, &telemetry);
            }
        }
        Ok(self.audit.finish())
    }
}

/// Runs one episode.
pub fn run_episode(
    controller: &Controller,
    config: &SilConfig,
    episode: &Episode,
    mut watch: Watch<'_>,
) -> Result<EpisodeResult, EvaluateError> {
    let mut robot = SimRobot::start(config, episode)?;
    let mut health = match controller.first() {
        None => wait_until(&mut robot, episode.settle_s)?,
        Some(set) => {
            robot.set_params(set);
            robot.ready_at(episode.settle_s)?
        }
    };
    let mut controller = controller.clone();
    if let Controller::Policy { policy, .. } = &mut controller {
        policy.reset();
    }
    let mut judge = Judge::new(robot.now_s());
    judge.saw(robot.now_s(), robot.pose(), &[]);
    let mut auditor = if let Watch::Odometry(_) = watch { Some(Auditor::new()?) } else { None };
    let origin = robot.pose().position_m;
    let (mut paper, mut gated) = (0.0, 0.0);
    let mut decisions = 0.0_f32;
    let horizon = ((episode.duration_s - episode.settle_s) / DECISION_S).max(1.0).floor();
    let mut second: Vec<Telemetry> = vec![];
    let slices_per_decision = (DECISION_S * 1e6) as u64 / SLICE_US;
    let mut slices = 0;
    while health == Health::Upright && robot.now_s() < episode.duration_s - 1e-3 {
        if slices % slices_per_decision == 0 {
            if let Some(set) = controller.choose(&second)? {
                robot.set_params(set);
            }
            second.clear();
        }
        let Slice { telemetry, health: now, pushed } = robot.advance()?;
        health = now;
        let now_s = robot.now_s();
        if pushed {
            judge.pushed(now_s);
            auditor.iter_mut().for_each(|auditor| auditor.audit.pushed(now_s));
        }
        judge.saw(now_s, robot.pose(), &telemetry);
        if let Watch::Recording(recording) = &mut watch {
            record(recording, &robot, &telemetry, origin);
        }
        if let Some(auditor) = &mut auditor {
            auditor.saw(&robot, health, &telemetry);
        }
        second.extend(telemetry);
        slices += 1;
        if slices % slices_per_decision == 0 && health == Health::Upright {
            let deed = judge.decide(now_s);
            decisions += 1.0;
            paper += deed.reward(RewardForm::Paper);
            gated += deed.reward(RewardForm::Gated);
        }
    }
    let at_s = robot.now_s();
    let energy = robot.body().meter().energy();
    if let (Some(auditor), Watch::Odometry(audited)) = (auditor, watch) {
        *audited = auditor.finish(&mut robot, health)?;
    }
    Ok(EpisodeResult {
        direction_deg: episode.direction.and(episode.pushes.first()).map(|push| push.direction_deg),
        impulse_n_s: episode.pushes.first().map_or(0.0, |push| push.impulse_n_s),
        seed: episode.seed,
        outcome: match health {
            Health::Upright => Outcome::Survived,
            Health::Fallen { .. } => Outcome::Fell { at_s },
            Health::NonFinite => Outcome::NonFinite { at_s },
            Health::Exploded { .. } => Outcome::Exploded { at_s },
        },
        steps: judge.steps(),
        steps_per_s: judge.steps_per_s(),
        drift_3s_m: judge.drift_3s_m(),
        settle_s: judge.settle_s(),
        energy_j: EnergyJ {
            actuators: energy.motors_j as f32,
            brakes: energy.brakes_j as f32,
            compute: energy.compute_j as f32,
        },
        // Slices may make one decision more than whole seconds do.
        reward_paper: paper / horizon.max(decisions),
        reward_gated: gated / horizon.max(decisions),
    })
}

fn wait_until(robot: &mut SimRobot, at_s: f32) -> Result<Health, LinkError> {
    loop {
        let health = robot.advance()?.health;
        if health != Health::Upright || robot.now_s() >= at_s - 1e-4 {
            return Ok(health);
        }
    }
}

fn record(recording: &mut Recording, robot: &SimRobot, telemetry: &[Telemetry], origin: [f32; 3]) {
    let [x, y, z] = robot.pose().position_m;
    let body = robot.body().robot();
    let trunk = body.trunk();
    let truth = Joint::ALL.map(|joint| body.joint(joint).position);
    // Figures list left and right of each kind.
    let by_kind = |[abd_l, hip_l, knee_l, abd_r, hip_r, knee_r]: [f32; 6]| [abd_l, abd_r, hip_l, hip_r, knee_l, knee_r];
    for frame in telemetry {
        recording.trace.samples.push(TraceSample {
            t_s: robot.now_s(),
            trunk_m: [x - origin[0], y - origin[1], z],
            accel_m_s2: acceleration_m_s2(frame),
            gyro_rad_s: rate_rad_s(frame),
            factor: frame.factor.to_f32(),
            phase: frame.phases[0],
            pads_n: loads_n(frame),
            joints: by_kind(frame.joints.map(|q| q.to_f32())),
        });
        // A picture shows one instant: what sensors say of it comes later.
        recording.poses.push(DrawnPose {
            t_s: robot.now_s(),
            trunk_m: trunk.position_m,
            trunk_quat: trunk.rotation_xyzw,
            joints: by_kind(truth),
            pads_n: body.pad_loads_n(),
        });
    }
}

/// Runs episodes `0..count` of a scenario on as many threads as there are cores; results in order. `done` is called
/// after each.
pub fn run_many(
    controller: &Controller,
    robots: &Robots,
    scenario: &Scenario,
    seed: u64,
    count: u64,
    done: &(dyn Fn() + Sync),
) -> Result<Vec<EpisodeResult>, EvaluateError> {
    parallel(count as usize, |index| {
        let robot = robots.of(episode_seed(seed, index as u64))?;
        let result = run_episode(controller, &robot, &scenario.episode(seed, index as u64), Watch::Nothing);
        done();
        result
    })
    .into_iter()
    .collect()
}

/// `work(0), work(1), …` on as many threads as there are cores, results in order.
pub fn parallel<T: Send>(count: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let threads = std::thread::available_parallelism().map_or(1, NonZero::get).min(count.max(1));
    let next = AtomicUsize::new(0);
    let results: Mutex<Vec<(usize, T)>> = Mutex::new(Vec::with_capacity(count));
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= count {
                        break;
                    }
                    let result = work(index);
                    // A poisoned lock means that another worker panicked; its panic ends the scope anyway.
                    results.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push((index, result));
                }
            });
        }
    });
    let mut results = results.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    results.sort_by_key(|(index, _)| *index);
    results.into_iter().map(|(_, result)| result).collect()
}

/// Estimated time on one charge: pushed as often as in `results`, and standing. `None` without results.
pub fn autonomy(config: &EnergyConfig, results: &[EpisodeResult]) -> Option<Autonomy> {
    let energy: Vec<EnergyJ> = results.iter().map(|result| result.energy_j).collect();
    let sum = |part: fn(&EnergyJ) -> f32| energy.iter().map(|one| f64::from(part(one))).sum::<f64>();
    // The computers draw constant power, so their energy tells the time.
    let seconds = sum(|one| one.compute) / config.compute_w;
    let moving_w = (sum(|one| one.actuators) + sum(|one| one.brakes)) / seconds;
    let battery_j = BATTERY_J * config.usable_charge;
    let standby_h = battery_j / config.compute_w / 3600.0;
    (seconds > 0.0)
        .then(|| Autonomy { mixed_h: (3.0 * battery_j / moving_w.max(1e-9) / 3600.0).min(standby_h), standby_h })
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicU32;

    use sarah_firmware::default_params;

    use super::*;
    use crate::enaf::{EnafConfig, Trainer};
    use crate::task::observation;

    #[test]
    fn parallel_does_everything_once_and_keeps_the_order() {
        for count in [0, 1, 2, 7, 100] {
            let runs = AtomicU32::new(0);
            let results = parallel(count, |index| {
                // Early ones take longest, so that late ones overtake them.
                std::thread::sleep(std::time::Duration::from_micros(200 * (count - index) as u64 % 1000));
                runs.fetch_add(1, Ordering::Relaxed);
                index * 3
            });
            assert_eq!(results, (0..count).map(|index| index * 3).collect::<Vec<_>>());
            assert_eq!(runs.into_inner() as usize, count);
        }
    }

    #[test]
    fn many_episodes_are_those_run_one_by_one() {
        let scenario = Scenario::load("push-grid").unwrap();
        let (controller, config) = (Controller::Braked, SilConfig::default());
        let done = AtomicU32::new(0);
        let many = run_many(&controller, &Robots::alike(config.clone()), &scenario, 5, 3, &|| {
            done.fetch_add(1, Ordering::Relaxed);
        });
        let one_by_one =
            (0..3).map(|index| run_episode(&controller, &config, &scenario.episode(5, index), Watch::Nothing));
        assert_eq!(many.unwrap(), one_by_one.collect::<Result<Vec<_>, _>>().unwrap());
        assert_eq!(done.into_inner(), 3);
    }

    #[test]
    fn the_second_of_two_sets_acts_once_the_robot_has_stepped() {
        let default = default_params();
        let episode = Scenario::load("train").unwrap().episode(7, 5);
        let run =
            |controller: &Controller| run_episode(controller, &SilConfig::default(), &episode, Watch::Nothing).unwrap();
        let constant = run(&Controller::Constants(default));
        assert!(constant.steps > 0);
        assert_eq!(run(&Controller::TwoSets { resting: default, stepping: default }), constant);
        assert_ne!(run(&Controller::TwoSets { resting: default, stepping: ParamSet::table_ii() }), constant);
    }

    #[test]
    fn a_policy_that_always_says_the_same_is_a_constant_set() {
        // An agent whose state-dependent part is shut acts by its constants alone.
        let start = action::encode(&default_params(), Scope::Knee);
        let trainer = Trainer::new(&EnafConfig::default(), observation::LEN, &start, 1).unwrap();
        let constant = action::decode(&default_params(), Scope::Knee, &trainer.mean_action());
        let policy = Controller::Policy { policy: Box::new(trainer.policy()), base: constant, scope: Scope::Knee };
        let episode = Scenario::load("push-grid").unwrap().episode(7, 5);
        let run =
            |controller: &Controller| run_episode(controller, &SilConfig::default(), &episode, Watch::Nothing).unwrap();
        assert_eq!(run(&policy), run(&Controller::Constants(constant)));
    }
}
