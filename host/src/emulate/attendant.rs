//! Whoever stands beside a simulated robot that a host trains: pushes it as the scenario says, episode after episode, and
//! puts it back on its feet when it has fallen.

use sarah_sim::robot::Health;
use sarah_sim::scenario::Scenario;
use sarah_sim::sil::SilError;
use sarah_sim::world::World;

/// A fallen robot lies for this long, µs: long enough for its host to notice.
const LIES_US: u64 = 1_500_000;

/// The attendant of one robot.
pub struct Attendant {
    scenario: Scenario,
    seed: u64,
    episode: u64,
    ends_us: u64,
    fallen_us: Option<u64>,
    falls: u32,
}

impl Attendant {
    /// Of a robot at the start of the scenario's first episode, which runs on after a fall from here on.
    pub fn new(scenario: &Scenario, seed: u64, world: &mut impl World) -> Attendant {
        world.run_on();
        let ends_us = world.now_us() + micros(scenario.duration_s);
        Attendant { scenario: scenario.clone(), seed, episode: 0, ends_us, fallen_us: None, falls: 0 }
    }

    /// Times the robot fell.
    pub fn falls(&self) -> u32 {
        self.falls
    }

    /// Looks at the robot; `health` is what it came to.
    pub fn look(&mut self, health: Health, world: &mut impl World) -> Result<(), SilError> {
        let now_us = world.now_us();
        let lies = match health {
            Health::Upright => self.fallen_us.is_some(),
            Health::Fallen { .. } => true,
            // Nothing that physics can go on from.
            _ => {
                self.fallen_us = Some(0);
                true
            }
        };
        if lies {
            if self.fallen_us.is_none() {
                self.falls += 1;
            }
            if now_us >= *self.fallen_us.get_or_insert(now_us) + LIES_US {
                self.fallen_us = None;
                let episode = self.next(now_us);
                world.body_mut().stand_up(&episode)?;
            }
        } else if now_us >= self.ends_us {
            let episode = self.next(now_us);
            world.body_mut().begin(&episode);
        }
        Ok(())
    }

    fn next(&mut self, now_us: u64) -> sarah_sim::scenario::Episode {
        self.episode += 1;
        self.ends_us = now_us + micros(self.scenario.duration_s);
        self.scenario.episode(self.seed, self.episode)
    }
}

fn micros(seconds: f32) -> u64 {
    (f64::from(seconds) * 1e6) as u64
}
