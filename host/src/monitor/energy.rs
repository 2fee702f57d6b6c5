//! What the robot draws, estimated from telemetry. Nothing on the robot measures it.
//!
//! The model is that of the simulator's meter ([`sarah_sim::energy`], whose constants serve here too): an actuator that
//! moves draws for its windings, its brake coil and its work; one that is braked draws nothing; the computers always
//! draw. Telemetry tells which generators move (their phases) and how far joints went; it does not tell forces, so work
//! is the way gone times a mean effort that makes the estimate agree with the simulator's meter (a test compares them).

use sarah_protocol::bus::Mode;
use sarah_protocol::telemetry::Telemetry;
use sarah_sim::energy::{BATTERY_J, EnergyConfig};

/// Mean force of a linear actuator while it moves, N. ASSUMPTION, from the simulated robot.
const KNEE_N: f64 = 130.0;
/// Mean torque of a hip or abductor while it moves, N·m. ASSUMPTION, from the simulated robot.
const SWING_N_M: f64 = 95.0;
/// The mean power shown is over about this, s.
const MEAN_S: f64 = 10.0;
/// Snapshots further apart say nothing about what was between them, s.
const GAP_S: f64 = 0.5;

/// Running estimate.
#[derive(Clone, Debug, Default)]
pub(super) struct Estimate {
    config: EnergyConfig,
    joints: Option<[f64; 6]>,
    /// Actuators that move now.
    pub(super) moving: usize,
    /// Motors and brake coils since the monitor began, J.
    pub(super) actuators_j: f64,
    /// Mean power of motors and brake coils, W.
    pub(super) actuators_w: f64,
}

impl Estimate {
    /// The next snapshot, `dt_s` after the one before.
    pub(super) fn push(&mut self, dt_s: f64, telemetry: &Telemetry) {
        let joints = telemetry.joints.map(|joint| f64::from(joint.to_f32()));
        let before = self.joints.replace(joints).unwrap_or(joints);
        // A knee drives in any phase of its cycle, the other two while they move; always one leg of each pair.
        let [knee, hip, abductor] = telemetry.phases;
        let driving = [knee != 0, hip == 2, abductor == 2].into_iter().filter(|drives| *drives).count();
        self.moving = if telemetry.mode == Mode::Armed { driving } else { 0 };
        if dt_s <= 0.0 || dt_s > GAP_S {
            return;
        }
        let gone = |joint: usize| (joints[joint] - before[joint]).abs();
        // A single snapshot between two moves still belongs to them: ways count only while something drives.
        let work_j = match self.moving {
            0 => 0.0,
            _ => KNEE_N * (gone(2) + gone(5)) + SWING_N_M * (gone(0) + gone(1) + gone(3) + gone(4)),
        };
        let idle_w = self.config.winding_w + self.config.brake_coil_w;
        let drawn_j = work_j / self.config.efficiency + self.moving as f64 * idle_w * dt_s;
        self.actuators_j += drawn_j;
        let share = (dt_s / MEAN_S).min(1.0);
        self.actuators_w += share * (drawn_j / dt_s - self.actuators_w);
    }

    /// Computers, controllers and sensors, W.
    pub(super) fn compute_w(&self) -> f64 {
        self.config.compute_w
    }

    /// How long full actuator batteries would last at the mean power, h; infinite at rest.
    pub(super) fn actuators_h(&self) -> f64 {
        3.0 * BATTERY_J * self.config.usable_charge / 3600.0 / self.actuators_w
    }

    /// How long a full battery of the computers lasts, h.
    pub(super) fn compute_h(&self) -> f64 {
        BATTERY_J * self.config.usable_charge / 3600.0 / self.config.compute_w
    }
}

#[cfg(test)]
mod tests {
    use sarah_firmware::default_params;
    use sarah_protocol::fixed::Q16;
    use sarah_sim::robot::Health;
    use sarah_sim::scenario::Scenario;
    use sarah_sim::sil::{Sil, SilConfig};

    use super::*;

    #[test]
    fn a_braked_robot_draws_for_its_computers_only() {
        let mut estimate = Estimate::default();
        for _ in 0..100 {
            estimate.push(0.01, &Telemetry { phases: [3, 2, 2], ..Telemetry::default() });
        }
        assert_eq!((estimate.moving, estimate.actuators_j), (0, 0.0));
        assert_eq!(estimate.compute_w(), 11.0);
        assert_eq!(estimate.actuators_h(), f64::INFINITY);
    }

    #[test]
    fn a_gap_or_a_wild_joint_counts_nothing_that_is_not_known() {
        let mut estimate = Estimate::default();
        let armed = Telemetry { mode: Mode::Armed, phases: [1, 0, 0], ..Telemetry::default() };
        estimate.push(0.01, &armed);
        estimate.push(30.0, &Telemetry { joints: [Q16::MAX; 6], ..armed });
        assert!(estimate.actuators_j < 1.0, "{}", estimate.actuators_j);
    }

    #[test]
    fn the_estimate_agrees_with_the_simulators_meter() {
        let scenario = Scenario::load("train").unwrap();
        let config = SilConfig { arm_at_boot: true, ..SilConfig::default() };
        let (mut estimated_j, mut metered_j) = (0.0, 0.0);
        for index in 0..6 {
            let episode = scenario.episode(7, index);
            let mut sil = Sil::new(&config, default_params(), default_params(), &episode).unwrap();
            let mut estimate = Estimate::default();
            for tick in 1..=(f64::from(episode.duration_s) * 100.0) as u64 {
                // What lies on the ground is no robot to fit.
                if sil.run_until(tick * 10_000).unwrap() != Health::Upright {
                    break;
                }
                estimate.push(0.01, &sil.coordinator().telemetry());
            }
            let energy = sil.meter().energy();
            estimated_j += estimate.actuators_j;
            metered_j += energy.motors_j + energy.brakes_j;
        }
        let ratio = estimated_j / metered_j;
        assert!((0.75..1.33).contains(&ratio), "{estimated_j} J estimated, {metered_j} J metered");
    }
}
