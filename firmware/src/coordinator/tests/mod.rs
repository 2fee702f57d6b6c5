//! The coordinator between fake nodes and a real host session.

mod losses;
mod promises;
mod real_nodes;
mod stranger;

use sarah_protocol::bus::{Gait, GaitEvent, NodeId, Side, Staged, Status, limits};
use sarah_protocol::host::{Command, HelloReply, Report, ToHost, VERSION, Which};
use sarah_protocol::params::SPECS;
use sarah_protocol::schema::schema_hash;
use sarah_protocol::session::{HostSession, News};
use sarah_protocol::telemetry::{Telemetry, faults};

use super::*;

/// A node as the bus sees it, with a cycle one can hold open.
#[derive(Clone)]
pub struct FakeNode {
    id: NodeId,
    default: ParamSet,
    applied: (u32, ParamSet),
    staged: Option<(u32, ParamSet)>,
    activate: Option<u32>,
    in_cycle: bool,
    cycle: u32,
    nonce: u16,
    mute: bool,
    deaf_to_boundary: bool,
    refuse: bool,
    halted: bool,
    /// Reported beside the latched halt.
    limits: u16,
    mode: Mode,
    halts: Vec<HaltReason>,
}

impl FakeNode {
    fn new(id: NodeId, default: ParamSet) -> Self {
        FakeNode {
            id,
            default,
            applied: (0, default),
            staged: None,
            activate: None,
            in_cycle: false,
            cycle: 0,
            nonce: 1,
            mute: false,
            deaf_to_boundary: false,
            refuse: false,
            halted: false,
            limits: 0,
            mode: Mode::Braked,
            halts: Vec::new(),
        }
    }

    fn restart(&mut self) {
        *self = FakeNode { nonce: self.nonce + 1, ..FakeNode::new(self.id, self.default) };
    }

    fn moving(&self) -> bool {
        self.mode == Mode::Armed && !self.halted
    }

    fn swap(&mut self, generation: u32) {
        if let Some(staged) = self.staged.filter(|staged| staged.0 == generation && !self.deaf_to_boundary) {
            self.applied = staged;
            self.staged = None;
        }
    }

    fn on_message(&mut self, message: &Message) -> Vec<Message> {
        if self.mute {
            return vec![];
        }
        match message {
            Message::Halt(reason) => {
                self.halted = true;
                self.halts.push(*reason);
            }
            Message::Motion(motion) => {
                self.halted &= motion.mode == Mode::Armed;
                self.mode = motion.mode;
            }
            Message::Stage(stage) => {
                let generation = stage.generation;
                if self.refuse {
                    let result = Err(sarah_protocol::params::ParamError::NotFinite { index: 2 });
                    return vec![Message::Staged(self.id, Staged { generation, result })];
                }
                let set = ParamSet::new(stage.params).expect("the coordinator checked it");
                if self.applied.0 != generation {
                    self.staged = Some((generation, set));
                }
                return vec![Message::Staged(self.id, Staged { generation, result: Ok(()) })];
            }
            Message::Activate(generation) if self.id == NodeId::Knee => self.activate = Some(*generation),
            Message::Gait(gait) => self.swap(gait.generation),
            _ => {}
        }
        vec![]
    }

    fn tick(&mut self) -> Vec<Message> {
        if self.mute {
            return vec![];
        }
        let mut out = vec![];
        if let Some(generation) = self.activate.filter(|_| !self.in_cycle) {
            self.swap(generation);
            if self.applied.0 == generation {
                self.activate = None;
                let gait = Gait { event: GaitEvent::Boundary, swing: Side::Left, cycle: self.cycle, generation };
                out.push(Message::Gait(gait));
            }
        }
        out.push(Message::Status(
            self.id,
            Status {
                position: [Q16::ZERO; 2],
                loads: [0; 4],
                phase: 0,
                factor: Q16::ZERO,
                steps: 0,
                cycle: self.cycle,
                applied: self.applied.0,
                staged: self.staged.map(|staged| staged.0),
                limits: self.limits | if self.halted { limits::HALTED } else { 0 },
                boot_nonce: self.nonce,
            },
        ));
        out
    }
}

pub struct Rig {
    pub coordinator: Coordinator,
    pub nodes: [FakeNode; 3],
    pub session: HostSession,
    pub other: Option<HostSession>,
    pub news: Vec<News>,
    pub other_news: Vec<News>,
    pub now: u32,
    pub host_us: u64,
    pub bus: BusOutbox,
    pub host: HostOutbox,
    pub imu: bool,
    pub host_connected: bool,
    pub store_works: bool,
    pub store_hangs: bool,
    pub stored: Option<(ParamSet, u32)>,
    /// Every generation the nodes ran at the same moment.
    pub seen: Vec<[u32; 3]>,
    /// Drop every n-th host frame in either direction; 0 is none.
    pub lossy: u32,
    count: u32,
}

pub fn default_set() -> ParamSet {
    ParamSet::table_ii()
}

/// A set `fraction` of the range away from the default, clamped.
pub fn other_set(fraction: f32) -> ParamSet {
    let values = core::array::from_fn(|i| {
        let spec = &SPECS[i];
        (default_set().values()[i] + fraction * (spec.max - spec.min)).clamp(spec.min, spec.max)
    });
    ParamSet::new(values).expect("clamped")
}

pub const NONCE: u32 = 0xb007;

pub fn config() -> Config {
    let identity = Identity { boot_nonce: NONCE, ..Identity::default() };
    Config { imu_period_us: 5_000, ..Config::new(identity, default_set(), default_set()) }
}

impl Rig {
    pub fn new(config: Config) -> Rig {
        // The clock wraps within the first second.
        Rig::at(config, u32::MAX - 700_000)
    }

    pub fn at(config: Config, now: u32) -> Rig {
        Rig {
            coordinator: Coordinator::new(config),
            nodes: NodeId::ALL.map(|id| FakeNode::new(id, config.default)),
            session: HostSession::new(1),
            other: None,
            news: vec![],
            other_news: vec![],
            now,
            host_us: 0,
            bus: BusOutbox::new(),
            host: HostOutbox::new(),
            imu: true,
            host_connected: true,
            store_works: true,
            store_hangs: false,
            stored: None,
            seen: vec![],
            lossy: 0,
            count: 0,
        }
    }

    /// Connected, claimed, armed.
    pub fn armed(config: Config) -> Rig {
        let mut rig = Rig::new(config);
        rig.run(600);
        rig.session.arm().expect("connected");
        rig.run(50);
        assert_eq!(rig.coordinator.mode(), Mode::Armed, "{:?}", rig.refusals());
        assert!(rig.nodes.iter().all(FakeNode::moving));
        rig
    }

    fn lost(&mut self) -> bool {
        self.count += 1;
        self.lossy != 0 && self.count.is_multiple_of(self.lossy)
    }

    pub fn bus_traffic(&mut self) {
        while let Some(frame) = self.bus.pop() {
            self.broadcast(None, &frame);
        }
    }

    fn broadcast(&mut self, from: Option<NodeId>, frame: &Frame) {
        let message = Message::decode(frame).expect("ours");
        for n in 0..3 {
            if from == Some(self.nodes[n].id) {
                continue;
            }
            for answer in self.nodes[n].on_message(&message) {
                self.coordinator.on_bus(self.now, &answer.encode(), &mut self.bus, &mut self.host);
            }
        }
    }

    pub fn host_bytes(&mut self, bytes: &[u8]) {
        self.coordinator.on_host_bytes(self.now, bytes, &mut self.bus, &mut self.host);
    }

    pub fn command(&mut self, session: u16, sequence: u16, command: Command) {
        let bytes = ToRobot::Command(command).encode(session, sequence).expect("fits");
        self.host_bytes(&bytes);
    }

    /// What the coordinator has said since, decoded; the session does not hear it.
    pub fn said(&mut self) -> Vec<ToHost> {
        let mut deframer: Deframer = Deframer::new();
        let mut said = vec![];
        while let Some(bytes) = self.host.pop() {
            for byte in bytes {
                if let Some(Ok(packet)) = deframer.push(byte) {
                    said.push(ToHost::decode(&packet).expect("ours"));
                }
            }
        }
        said
    }

    /// The states of all acks said since.
    pub fn acks(&mut self) -> Vec<AckState> {
        let ack = |message| match message {
            ToHost::Report(Report::Ack(ack)) => Some(ack.state),
            _ => None,
        };
        self.said().into_iter().filter_map(ack).collect()
    }

    /// One millisecond.
    pub fn step(&mut self) {
        self.now = self.now.wrapping_add(1_000);
        self.host_us += 1_000;
        let millis = self.host_us / 1_000;
        if self.imu && millis.is_multiple_of(5) {
            let rest = ImuSample { accel: [0, 0, 2048], gyro: [0; 3] };
            self.coordinator.on_imu(self.now, &rest, &mut self.bus);
        }
        self.bus_traffic();
        if millis.is_multiple_of(10) {
            for n in 0..3 {
                for message in self.nodes[n].tick() {
                    let frame = message.encode();
                    self.coordinator.on_bus(self.now, &frame, &mut self.bus, &mut self.host);
                    self.broadcast(Some(self.nodes[n].id), &frame);
                }
            }
        }
        if self.host_connected {
            self.host_traffic();
        }
        if let Some(Action::Store(params, generation)) = self.coordinator.tick(self.now, &mut self.bus, &mut self.host)
        {
            self.stored = Some((params, generation)).filter(|_| self.store_works && !self.store_hangs);
            if !self.store_hangs {
                self.coordinator.on_stored(generation, self.store_works, &mut self.host);
            }
        }
        let now = self.nodes.each_ref().map(|node| node.applied.0);
        if self.seen.last() != Some(&now) {
            self.seen.push(now);
        }
    }

    fn host_traffic(&mut self) {
        while let Some(bytes) = self.session.poll(self.host_us) {
            if !self.lost() {
                self.host_bytes(&bytes);
            }
        }
        if let Some(mut other) = self.other.take() {
            while let Some(bytes) = other.poll(self.host_us) {
                self.host_bytes(&bytes);
            }
            self.other = Some(other);
        }
        while let Some(bytes) = self.host.pop() {
            if self.lost() {
                continue;
            }
            self.session.on_bytes(self.host_us, &bytes, &mut |news| self.news.push(news));
            if let Some(other) = &mut self.other {
                other.on_bytes(self.host_us, &bytes, &mut |news| self.other_news.push(news));
            }
        }
    }

    pub fn run(&mut self, millis: u32) {
        for _ in 0..millis {
            self.step();
        }
    }

    pub fn refusals(&self) -> Vec<Refusal> {
        let refusal = |news: &News| if let News::Refused(_, refusal) = news { Some(*refusal) } else { None };
        self.news.iter().filter_map(refusal).collect()
    }

    pub fn events(&self) -> Vec<Event> {
        let event = |news: &News| if let News::Event { event, .. } = news { Some(*event) } else { None };
        self.news.iter().filter_map(event).collect()
    }

    pub fn telemetry(&self) -> Telemetry {
        self.coordinator.telemetry()
    }

    pub fn moving(&self) -> bool {
        self.nodes.iter().any(FakeNode::moving)
    }

    /// The robot's supply was cut and came back: new nonces, stored set from memory, nobody armed.
    pub fn power_cycle(&mut self, config: Config) {
        self.coordinator = Coordinator::new(config);
        self.nodes.iter_mut().for_each(FakeNode::restart);
        self.bus = BusOutbox::new();
        self.host = HostOutbox::new();
    }

    pub fn applied_everywhere(&self) -> Option<(u32, ParamSet)> {
        let first = self.nodes[0].applied;
        self.nodes.iter().all(|node| node.applied == first).then_some(first)
    }

    pub fn robot(&self) -> Option<&HelloReply> {
        self.session.robot()
    }
}
