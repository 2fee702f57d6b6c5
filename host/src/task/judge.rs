//! Measures a run of the robot from its telemetry and, in simulation, from the truth.

use sarah_protocol::telemetry::Telemetry;

use super::observation::unbiased_rate_rad_s;
use super::reward::{DISTURBED_RAD_S, Deed, FREQUENCY_WINDOW_S};

/// Rotation below which the trunk counts as quiet, rad/s.
const QUIET_RAD_S: f32 = 0.02;
/// Quiet must last this long, s.
const QUIET_FOR_S: f32 = 0.5;
/// Steps of one recovery are those within this time of the push, s.
const RECOVERY_S: f32 = 3.0;

/// Where the trunk truly is. On a robot, [`super::odometry`] stands in for it.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Pose {
    /// Position of the trunk, m.
    pub position_m: [f32; 3],
    /// Its rotation speed, rad/s.
    pub rotation_rad_s: f32,
    /// Its standing height, m.
    pub standing_m: f32,
}

/// One push and what came of it.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Recovery {
    pushed_at_s: f32,
    from_m: [f32; 2],
    drift_3s_m: Option<f32>,
    settled_s: Option<f32>,
}

/// Follows an episode slice by slice.
#[derive(Clone, Debug)]
pub struct Judge {
    origin_m: Option<[f32; 2]>,
    pose: Pose,
    first_steps: Option<u32>,
    last_steps: u32,
    step_times_s: Vec<f32>,
    ticks: u32,
    disturbed: u32,
    quiet_since_s: Option<f32>,
    recoveries: Vec<Recovery>,
    began_s: f32,
}

impl Judge {
    /// Nothing seen yet; the run begins at `began_s`.
    pub fn new(began_s: f32) -> Judge {
        Judge {
            origin_m: None,
            pose: Pose::default(),
            first_steps: None,
            last_steps: 0,
            step_times_s: vec![],
            ticks: 0,
            disturbed: 0,
            quiet_since_s: None,
            recoveries: vec![],
            began_s,
        }
    }

    /// The robot is pushed now.
    pub fn pushed(&mut self, now_s: f32) {
        let [x, y, _] = self.pose.position_m;
        self.quiet_since_s = None;
        self.recoveries.push(Recovery { pushed_at_s: now_s, from_m: [x, y], drift_3s_m: None, settled_s: None });
    }

    /// A slice of time has passed; `telemetry` is what arrived in it.
    pub fn saw(&mut self, now_s: f32, pose: Pose, telemetry: &[Telemetry]) {
        let [x, y, _] = pose.position_m;
        self.origin_m.get_or_insert([x, y]);
        self.pose = pose;
        let mut idle = true;
        for frame in telemetry {
            let spin = unbiased_rate_rad_s(frame).iter().map(|w| w * w).sum::<f32>().sqrt();
            let stepping = frame.phases[0] != 0;
            idle &= !stepping;
            self.ticks += 1;
            self.disturbed += u32::from(stepping || spin > DISTURBED_RAD_S);
            let before = if self.first_steps.is_some() { self.last_steps } else { frame.steps };
            self.first_steps.get_or_insert(frame.steps);
            for _ in 0..frame.steps.wrapping_sub(before).min(10) {
                self.step_times_s.push(now_s);
            }
            self.last_steps = frame.steps;
        }
        self.watch_quiet(now_s, idle && pose.rotation_rad_s < QUIET_RAD_S);
        if let Some(last) = self.recoveries.last_mut()
            && last.drift_3s_m.is_none()
            && now_s - last.pushed_at_s >= RECOVERY_S
        {
            last.drift_3s_m = Some((x - last.from_m[0]).hypot(y - last.from_m[1]));
        }
    }

    fn watch_quiet(&mut self, now_s: f32, quiet: bool) {
        if !quiet {
            self.quiet_since_s = None;
            return;
        }
        let since = *self.quiet_since_s.get_or_insert(now_s);
        if let Some(last) = self.recoveries.last_mut()
            && last.settled_s.is_none()
            && now_s - since >= QUIET_FOR_S
        {
            last.settled_s = Some((since - last.pushed_at_s).max(0.0));
        }
    }

    /// Closes a decision: what it did since the last one.
    pub fn decide(&mut self, now_s: f32) -> Deed {
        let window = FREQUENCY_WINDOW_S.min(now_s - self.began_s).max(0.1);
        let steps = self.step_times_s.iter().rev().take_while(|t| **t > now_s - window).count();
        let [x, y, z] = self.pose.position_m;
        let [x0, y0] = self.origin_m.unwrap_or([x, y]);
        let deed = Deed {
            displacement_m: [x - x0, y - y0],
            height: z / self.pose.standing_m,
            steps_per_s: steps as f32 / window,
            disturbed: self.disturbed as f32 / self.ticks.max(1) as f32,
        };
        (self.ticks, self.disturbed) = (0, 0);
        deed
    }

    /// Steps taken since the first telemetry.
    pub fn steps(&self) -> u32 {
        self.first_steps.map_or(0, |first| self.last_steps.wrapping_sub(first))
    }

    /// Step frequency in recovery, 1/s: over the first and last of at least three steps within 3 s of a push, mean
    /// over the pushes that made the robot step so often.
    pub fn steps_per_s(&self) -> Option<f32> {
        let rates: Vec<f32> = self
            .recoveries
            .iter()
            .filter_map(|push| {
                let within = |t: &&f32| (0.0..=RECOVERY_S).contains(&(**t - push.pushed_at_s));
                let times: Vec<f32> = self.step_times_s.iter().filter(within).copied().collect();
                match times[..] {
                    [first, _, .., last] if times.len() >= 3 && last > first => {
                        Some((times.len() - 1) as f32 / (last - first))
                    }
                    _ => None,
                }
            })
            .collect();
        mean(&rates)
    }

    /// Mean distance from where the trunk was pushed, 3 s later, m.
    pub fn drift_3s_m(&self) -> Option<f32> {
        mean(&self.recoveries.iter().filter_map(|push| push.drift_3s_m).collect::<Vec<_>>())
    }

    /// Longest time from a push until quiet, s; `None` if it did not become quiet after one of them.
    pub fn settle_s(&self) -> Option<f32> {
        let times: Option<Vec<f32>> = self.recoveries.iter().map(|push| push.settled_s).collect();
        times?.into_iter().reduce(f32::max)
    }
}

fn mean(values: &[f32]) -> Option<f32> {
    (!values.is_empty()).then(|| values.iter().sum::<f32>() / values.len() as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bias_that_is_known_disturbs_nobody() {
        // 250 counts are 0.27 rad/s.
        let seen = |gyro_bias| Telemetry { gyro: [250, 0, 0], gyro_bias, ..Telemetry::default() };
        for (frame, disturbed) in [(seen([250, 0, 0]), 0.0), (seen([0; 3]), 1.0)] {
            let mut judge = Judge::new(0.0);
            judge.saw(0.01, Pose::default(), &[frame]);
            assert_eq!(judge.decide(1.0).disturbed, disturbed);
        }
    }
}
