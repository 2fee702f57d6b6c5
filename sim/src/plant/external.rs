//! The robot in another process: any simulator that speaks the words of [`super::wire`].

use rapier3d::math::{Rotation, Vector};
use sarah_protocol::frame::checksum;

use super::process::{Patience, Process};
use super::wire::{FromPlant, Setup, Snapshot, Step, ToPlant};
use super::{Plant, PlantError};
use crate::robot::{
    Drive, Geometry, Health, ImuState, Joint, JointState, RobotConfig, SARAH_MJCF, TrunkState, ground_turn, lean_rad,
    verdict,
};
use crate::sil::SilError;

/// A robot simulated elsewhere. When dropped, its process waits for the next one.
pub struct External {
    /// `None` once it has failed or been handed on.
    process: Option<Process>,
    patience: Patience,
    name: String,
    geometry: Geometry,
    ground_normal: Vector,
    dt_s: f32,
    steps: u64,
    drives: [Drive; 6],
    push: Option<([f32; 3], f32)>,
    now: Snapshot,
}

impl External {
    /// Lets `command` (a program and its arguments, separated by spaces) put up the robot of `config`.
    pub fn start(command: &str, config: &RobotConfig) -> Result<External, SilError> {
        config.validate()?;
        let geometry = Geometry::load()?;
        Ok(Self::over(Process::start(command)?, Patience::default(), geometry, config)?)
    }

    pub(super) fn over(
        mut process: Process,
        patience: Patience,
        geometry: Geometry,
        config: &RobotConfig,
    ) -> Result<External, PlantError> {
        let setup = ToPlant::Setup(setup(config));
        let doing = || "it was to put up a robot".to_owned();
        let reply = process.ask(&setup, patience.setup, doing)?;
        let command = process.command.clone();
        let (model, now, name) = match reply {
            FromPlant::Ready { model, snapshot, name } => (model, snapshot, name),
            FromPlant::Refused { setting, why } => {
                // Refusing is no fault: it may be asked for another robot.
                process.rest();
                let (setting, why) = (setting.as_str().into(), why.as_str().into());
                return Err(PlantError::Refused { command, setting, why });
            }
            FromPlant::Done(_) => {
                return Err(PlantError::Malformed { command, doing: doing(), what: "the reply to a step".into() });
            }
        };
        let (theirs, ours) = (u32::from_le_bytes(model), model_crc());
        if theirs != ours {
            return Err(PlantError::Model { command, theirs, ours });
        }
        Ok(External {
            process: Some(process),
            patience,
            name: name.as_str().into(),
            geometry,
            ground_normal: ground_turn(config) * Vector::Z,
            dt_s: config.dt_s,
            steps: 0,
            drives: [Drive::Brake; 6],
            push: None,
            now,
        })
    }

    /// Who simulates, such as `mujoco 3.3.7`.
    pub fn name(&self) -> &str {
        &self.name
    }

    fn acting(&self) -> Step {
        let (force_n, height_m) = self.push.unwrap_or_default();
        let mut step = Step { released: 0, speeds: [0.0; 6], force_n, height_m };
        for (i, drive) in self.drives.iter().enumerate() {
            if let Drive::Velocity(speed) = drive {
                step.released |= 1 << i;
                step.speeds[i] = *speed;
            }
        }
        step
    }

    fn advance(&self, process: &mut Process) -> Result<Snapshot, PlantError> {
        let doing = || format!("it was to make step {}, at {:.3} s", self.steps + 1, self.time_s());
        match process.ask(&ToPlant::Step(self.acting()), self.patience.step, doing)? {
            FromPlant::Done(snapshot) => Ok(snapshot),
            _ => Err(PlantError::Malformed {
                command: process.command.clone(),
                doing: doing(),
                what: "the reply to a setup".into(),
            }),
        }
    }
}

/// CRC-32 of the robot's description.
pub(super) fn model_crc() -> u32 {
    checksum(SARAH_MJCF.as_bytes())
}

fn setup(config: &RobotConfig) -> Setup {
    let scales = Joint::ALL.map(|joint| config.actuator_scales(joint));
    Setup {
        model: model_crc().to_le_bytes(),
        dt_s: config.dt_s,
        drop_m: config.drop_m,
        payload_kg: config.payload_kg,
        com_shift_m: config.com_shift_m,
        mass_scale: config.mass_scale,
        friction: config.friction.unwrap_or(f32::NAN),
        slope_rad: [config.slope_pitch_rad, config.slope_roll_rad],
        speed_scales: scales.map(|(speed, _)| speed),
        force_scales: scales.map(|(_, force)| force),
    }
}

impl Plant for External {
    fn drive(&mut self, joint: Joint, drive: Drive) {
        self.drives[joint as usize] = drive.or_brake();
    }

    fn driven(&self, joint: Joint) -> Drive {
        self.drives[joint as usize]
    }

    fn push(&mut self, force_n: [f32; 3], height_m: f32) {
        self.push = Some((force_n, height_m));
    }

    fn clear_push(&mut self) {
        self.push = None;
    }

    fn step(&mut self) -> Result<(), PlantError> {
        // Taken, so that one that fails is ended and never asked again.
        let mut process = self.process.take().ok_or_else(|| PlantError::Ended {
            command: self.name.clone(),
            doing: "it was to make another step".into(),
            why: "it has failed before".into(),
        })?;
        self.now = self.advance(&mut process)?;
        self.process = Some(process);
        self.steps += 1;
        Ok(())
    }

    fn joint(&self, joint: Joint) -> JointState {
        JointState { position: self.now.joints[joint as usize], velocity: self.now.joint_speeds[joint as usize] }
    }

    fn effort(&self, joint: Joint) -> f32 {
        self.now.efforts[joint as usize]
    }

    fn pad_loads_n(&self) -> [f32; 4] {
        self.now.pads_n
    }

    fn trunk(&self) -> TrunkState {
        let Snapshot { position_m, rotation_xyzw, velocity_m_s, angular_velocity_rad_s, .. } = self.now;
        TrunkState { position_m, rotation_xyzw, velocity_m_s, angular_velocity_rad_s }
    }

    fn imu(&self) -> ImuState {
        let TrunkState { rotation_xyzw, velocity_m_s, angular_velocity_rad_s, .. } = self.trunk();
        let arm = Rotation::from_array(rotation_xyzw) * Vector::from_array(self.geometry.imu_m);
        let turning = Vector::from_array(angular_velocity_rad_s).cross(arm);
        let velocity_m_s = (Vector::from_array(velocity_m_s) + turning).to_array();
        ImuState { velocity_m_s, angular_velocity_rad_s, rotation_xyzw }
    }

    fn health(&self) -> Health {
        let Snapshot { position_m, rotation_xyzw, velocity_m_s, angular_velocity_rad_s, joints, joint_speeds, .. } =
            &self.now;
        let all = [&position_m[..], rotation_xyzw, velocity_m_s, angular_velocity_rad_s, joints, joint_speeds];
        if !all.into_iter().flatten().all(|value| value.is_finite()) {
            return Health::NonFinite;
        }
        // Of the legs only the joints are known; they move against the trunk.
        let of = |linear: bool| Joint::ALL.into_iter().filter(move |joint| joint.is_linear() == linear);
        let fastest = |start: [f32; 3], linear| {
            of(linear)
                .map(|joint| joint_speeds[joint as usize].abs())
                .fold(Vector::from_array(start).length(), f32::max)
        };
        let (speed_m_s, spin_rad_s) = (fastest(*velocity_m_s, true), fastest(*angular_velocity_rad_s, false));
        verdict(speed_m_s, spin_rad_s, [self.height_m(), self.standing_height_m()], lean_rad(*rotation_xyzw))
    }

    fn height_m(&self) -> f32 {
        Vector::from_array(self.now.position_m).dot(self.ground_normal) / self.ground_normal.z
    }

    fn standing_height_m(&self) -> f32 {
        self.geometry.standing_m
    }

    fn gravity_m_s2(&self) -> f32 {
        self.geometry.gravity_m_s2
    }

    fn time_s(&self) -> f64 {
        self.steps as f64 * f64::from(self.dt_s)
    }

    fn dt_s(&self) -> f32 {
        self.dt_s
    }
}

impl Drop for External {
    fn drop(&mut self) {
        if let Some(process) = self.process.take() {
            process.rest();
        }
    }
}
