//! The robot as the world an agent learns in: an observation, an action, a reward, once a second.

use sarah_protocol::params::ParamSet;
use sarah_sim::robot::Health;
use sarah_sim::scenario::Scenario;
use thiserror::Error;

use super::action::Scope;
use super::judge::Judge;
use super::reward::RewardForm;
use super::robots::Robots;
use super::{action, observation};
use crate::enaf::{End, EnvError, Environment, Outcome};
use crate::link::sim::{LinkError, SLICE_US, SimRobot};

/// Time between two decisions, s (paper, §II.C).
pub const DECISION_S: f32 = 1.0;

/// An episode that teaches nothing: the simulation failed, or the robot fell before the first decision.
#[derive(Debug, Error)]
#[error(
    "no episode came about at {at_s:.2} s ({health:?}): is the robot able to stand, with this slope, payload and drop?"
)]
pub struct BrokenWorld {
    /// When.
    pub at_s: f32,
    /// How.
    pub health: Health,
}

/// One session's world: the simulated robot, of which the agent moves some parameters.
pub struct RobotEnvironment {
    robots: Robots,
    scenario: Scenario,
    base: ParamSet,
    scope: Scope,
    form: RewardForm,
    run: Option<Run>,
}

struct Run {
    robot: SimRobot,
    judge: Judge,
    until_s: f32,
}

/// Decisions in a full episode of a scenario.
pub fn horizon(scenario: &Scenario) -> usize {
    ((scenario.duration_s - scenario.settle_s) / DECISION_S).floor().max(1.0) as usize
}

impl RobotEnvironment {
    /// A world in which `scope` is trained and everything else is as in `base`.
    pub fn new(robots: Robots, scenario: Scenario, base: ParamSet, scope: Scope, form: RewardForm) -> Self {
        RobotEnvironment { robots, scenario, base, scope, form, run: None }
    }

    /// Other robots, from the next reset on.
    pub fn inhabit(&mut self, robots: Robots) {
        self.robots = robots;
    }

    /// Decisions in a full episode.
    pub fn horizon(&self) -> usize {
        horizon(&self.scenario)
    }
}

impl Environment for RobotEnvironment {
    fn observation_len(&self) -> usize {
        observation::LEN
    }

    fn action_len(&self) -> usize {
        self.scope.range().len()
    }

    fn reset(&mut self, episode_seed: u64) -> Result<Vec<f32>, EnvError> {
        let episode = self.scenario.episode(episode_seed, 0);
        let mut robot = SimRobot::start(&self.robots.of(episode_seed)?, &episode)?;
        robot.set_params(self.base);
        let health = robot.ready_at(episode.settle_s)?;
        if health != Health::Upright {
            return Err(BrokenWorld { at_s: robot.now_s(), health }.into());
        }
        let mut judge = Judge::new(robot.now_s());
        judge.saw(robot.now_s(), robot.pose(), &[]);
        self.run = Some(Run { robot, judge, until_s: episode.duration_s });
        Ok(observation::observe(&[]))
    }

    fn decide(&mut self, action: &[f32]) -> Result<Outcome, EnvError> {
        let Some(run) = &mut self.run else { return Err(LinkError::Silent("deciding before the reset").into()) };
        run.robot.set_params(action::decode(&self.base, self.scope, action));
        let mut second = vec![];
        for _ in 0..(DECISION_S * 1e6) as u64 / SLICE_US {
            let slice = run.robot.advance()?;
            let now_s = run.robot.now_s();
            if slice.pushed {
                run.judge.pushed(now_s);
            }
            run.judge.saw(now_s, run.robot.pose(), &slice.telemetry);
            second.extend(slice.telemetry);
            match slice.health {
                Health::Upright => {}
                Health::Fallen { .. } => {
                    let observation = observation::observe(&second);
                    self.run = None;
                    return Ok(Outcome { observation, reward: 0.0, end: Some(End::Fall) });
                }
                health => return Err(BrokenWorld { at_s: now_s, health }.into()),
            }
        }
        let now_s = run.robot.now_s();
        let reward = run.judge.decide(now_s).reward(self.form);
        let end = (now_s + DECISION_S > run.until_s + 1e-3).then_some(End::TimeOut);
        Ok(Outcome { observation: observation::observe(&second), reward, end })
    }
}
