//! Fixtures: a simulated robot with its firmware and, at the other end of the line, a host session. [`images`]: what is
//! flashed, by its machine code.

pub mod images;

use sarah_firmware::default_params;
use sarah_firmware::lpg::Drive;
use sarah_firmware::lpg::knee::Phase;
use sarah_firmware::node::{KneeNode, NodeKind};
use sarah_protocol::bus::{Mode, NodeId};
use sarah_protocol::params::{ParamSet, SPECS};
use sarah_protocol::session::{HostSession, News};
use sarah_protocol::telemetry::Event;
use sarah_sim::line::Line;
use sarah_sim::robot::Health;
use sarah_sim::scenario::{Episode, Push};
use sarah_sim::sil::{Sil, SilConfig};

/// Everything braked.
pub const BRAKED: [Drive; 6] = [Drive::Brake; 6];

/// A push of `impulse_n_s` at `at_s`; 0° is forward, 90° to the left.
pub fn push(at_s: f32, impulse_n_s: f32, direction_deg: f32) -> Push {
    Push { at_s, impulse_n_s, direction_deg, duration_s: 0.1, height_m: 0.0 }
}

/// An episode without end that starts 5 mm above the ground.
pub fn episode(seed: u64, pushes: &[Push]) -> Episode {
    Episode {
        index: 0,
        seed,
        duration_s: 3600.0,
        settle_s: 0.5,
        drop_m: 0.005,
        pushes: pushes.to_vec(),
        direction: None,
    }
}

/// The usual robot, arming itself.
pub fn unattended() -> SilConfig {
    SilConfig { arm_at_boot: true, ..SilConfig::default() }
}

/// The default set with every value moved by `share` of its range, towards the inside where it would leave it.
pub fn near_default(share: f32) -> ParamSet {
    let default = default_params();
    let values = core::array::from_fn(|index| {
        let spec = &SPECS[index];
        let (value, change) = (default.values()[index], share * (spec.max - spec.min));
        if (spec.min..=spec.max).contains(&(value + change)) { value + change } else { value - change }
    });
    ParamSet::new(values).expect("moved towards the inside")
}

/// Sebastiano Vigna's SplitMix64: enough chance for a test.
#[derive(Clone, Debug)]
pub struct Dice(pub u64);

impl Dice {
    /// The next 64 bits.
    pub fn roll(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// True once in `n` on average.
    pub fn once_in(&mut self, n: u64) -> bool {
        self.roll().is_multiple_of(n)
    }
}

/// A robot and a host, a millisecond at a time.
pub struct Bench {
    /// The robot.
    pub sil: Sil,
    /// The host's end of the line.
    pub session: HostSession,
    /// What the host learned, telemetry excepted.
    pub news: Vec<News>,
    /// Whether the line is connected.
    pub plugged: bool,
    /// What spoils the line, if anything.
    pub noise: Option<Line>,
    /// The last verdict; the bench stands still once it is not upright.
    pub health: Health,
}

impl Bench {
    /// Powered up with the default set everywhere, and a host on the line.
    pub fn new(config: &SilConfig, episode: &Episode) -> Bench {
        Bench::with_set(config, default_params(), episode)
    }

    /// Powered up with `set` built in and stored.
    pub fn with_set(config: &SilConfig, set: ParamSet, episode: &Episode) -> Bench {
        Bench {
            sil: Sil::new(config, set, set, episode).expect("a valid configuration"),
            session: HostSession::new(7),
            news: vec![],
            plugged: true,
            noise: None,
            health: Health::Upright,
        }
    }

    /// The same with nobody on the line.
    pub fn alone(config: &SilConfig, episode: &Episode) -> Bench {
        Bench { plugged: false, ..Bench::new(config, episode) }
    }

    /// Powered up and armed by the host, one second in.
    pub fn armed(config: &SilConfig, episode: &Episode) -> Bench {
        let mut bench = Bench::new(config, episode);
        bench.run_until_ms(900);
        bench.session.arm().expect("connected");
        bench.run_until_ms(1000);
        assert_eq!(bench.mode(), Mode::Armed, "{:?}", bench.news);
        bench
    }

    /// One millisecond of the world and of the line.
    pub fn step(&mut self) {
        if self.health != Health::Upright {
            return;
        }
        let now_us = self.sil.now_us();
        if self.plugged {
            while let Some(bytes) = self.session.poll(now_us) {
                let bytes = self.through_the_line(&bytes);
                self.sil.host_write(&bytes);
            }
        }
        self.health = self.sil.run_until(now_us + 1000).expect("rapier goes on");
        let bytes = self.sil.host_read();
        if self.plugged {
            let bytes = self.through_the_line(&bytes);
            let news = &mut self.news;
            self.session.on_bytes(self.sil.now_us(), &bytes, &mut |item| {
                if !matches!(item, News::Telemetry(_)) {
                    news.push(item);
                }
            });
        }
    }

    fn through_the_line(&mut self, bytes: &[u8]) -> Vec<u8> {
        match &mut self.noise {
            Some(line) => line.pass(bytes),
            None => bytes.to_vec(),
        }
    }

    /// `millis` steps.
    pub fn run_ms(&mut self, millis: u64) {
        (0..millis).for_each(|_| self.step());
    }

    /// Steps to this time.
    pub fn run_until_ms(&mut self, at_ms: u64) {
        while self.sil.now_us() < at_ms * 1000 && self.health == Health::Upright {
            self.step();
        }
    }

    /// Steps until `condition` holds, at most `limit_ms`; how long it took, ms.
    pub fn wait(&mut self, limit_ms: u64, mut condition: impl FnMut(&Bench) -> bool) -> Option<u64> {
        (0..=limit_ms).find(|_| {
            let holds = condition(self);
            if !holds {
                self.step();
            }
            holds
        })
    }

    /// Armed or braked, as the coordinator has it.
    pub fn mode(&self) -> Mode {
        self.sil.coordinator().mode()
    }

    /// Everything the robot said happened.
    pub fn events(&self) -> Vec<Event> {
        let event = |news: &News| if let News::Event { event, .. } = news { Some(*event) } else { None };
        self.news.iter().filter_map(event).collect()
    }

    /// The knee node.
    pub fn knee(&self) -> &KneeNode {
        knee(&self.sil)
    }

    /// A cycle is running.
    pub fn in_cycle(&self) -> bool {
        self.knee().lpg().phase() != Phase::Idle
    }

    /// Whether all six brakes are engaged.
    pub fn braked(&self) -> bool {
        self.sil.commands() == BRAKED
    }

    /// Steps counted since power-up.
    pub fn steps(&self) -> u32 {
        self.knee().lpg().steps()
    }
}

/// The knee node of a robot.
pub fn knee(sil: &Sil) -> &KneeNode {
    match sil.node(NodeId::Knee) {
        NodeKind::Knee(node) => node,
        NodeKind::Swing(_) => unreachable!("the knee node is a knee node"),
    }
}

/// Generation in force in each node.
pub fn generations(sil: &Sil) -> [u32; 3] {
    NodeId::ALL.map(|id| match sil.node(id) {
        NodeKind::Knee(node) => node.generation(),
        NodeKind::Swing(node) => node.generation(),
    })
}

/// Horizontal distance of the trunk from the point above which it started, m.
pub fn drift_m(sil: &Sil, from: [f32; 3]) -> f32 {
    let [x, y, _] = sil.robot().trunk().position_m;
    (x - from[0]).hypot(y - from[1])
}
