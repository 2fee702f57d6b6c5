//! The robot with its four emulated chips, and a host at the other end of the line: a millisecond at a time.
//!
//! Any violation that a chip's models report ends the test.

use samc21::Cycles;
use samc21::wires::Serial;
use sarah_firmware::calibration::Command as Pins;
use sarah_firmware::default_params;
use sarah_firmware::lpg::knee::Phase;
use sarah_protocol::bus::{Frame, GaitEvent, Message, Mode, NodeId};
use sarah_protocol::frame::Deframer;
use sarah_protocol::host::{Command, ParamsReport, Refusal, Report, ToHost, Which};
use sarah_protocol::params::{ParamSet, SPECS};
use sarah_protocol::session::{HostSession, News};
use sarah_protocol::telemetry::{Event, Telemetry};
use sarah_sim::emulated::{COORDINATOR, Emulated};
use sarah_sim::robot::{Drive, Health, Joint};
use sarah_sim::scenario::{Episode, Push};
use sarah_sim::sil::SilConfig;
use sarah_sim::world::World;

use crate::build::images;
use crate::snapshot::HOST_SERCOM;

/// Both actuators of a node, braked.
pub const BRAKED: [Pins; 2] = [Pins::Brake; 2];
/// From power-up to an armed robot, ms; the crystal alone takes 500.
const READY_MS: u64 = 1_500;
/// The push of [`Rig::mid_step`], s since power-up, and how long its step may be in coming, ms.
const STEP_PUSH_S: f32 = 1.5;
const STEP_MS: u64 = 1_500;

/// A push of `impulse_n_s` at `at_s`; 0° is forward, 90° to the left.
pub fn push(at_s: f32, impulse_n_s: f32, direction_deg: f32) -> Push {
    Push { at_s, impulse_n_s, direction_deg, duration_s: 0.1, height_m: 0.0 }
}

/// The push that makes [`Rig::mid_step`] step.
pub fn step_push() -> Push {
    push(STEP_PUSH_S, 17.0, 0.0)
}

/// The default set with every value moved by `share` of its range, towards the inside where it would leave it.
pub fn near_default(share: f32) -> ParamSet {
    let default = default_params();
    let values = std::array::from_fn(|index| {
        let spec = &SPECS[index];
        let (value, change) = (default.values()[index], share * (spec.max - spec.min));
        if (spec.min..=spec.max).contains(&(value + change)) { value + change } else { value - change }
    });
    ParamSet::new(values).expect("moved towards the inside")
}

/// What a bad line does to bytes.
pub type Line = Box<dyn FnMut(&[u8]) -> Vec<u8>>;

/// A message that passed the bus.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Passed {
    /// End of its frame.
    pub at: Cycles,
    /// The message.
    pub message: Message,
}

/// Robot, chips and host.
pub struct Rig {
    /// The robot.
    pub robot: Emulated,
    /// The host's end of the line.
    pub session: HostSession,
    /// What the host learned, telemetry and events excepted.
    pub news: Vec<News>,
    /// The newest telemetry that the robot sent, whether the host got it or not.
    pub telemetry: Telemetry,
    /// Everything the robot said happened, likewise.
    pub events: Vec<Event>,
    tap: Deframer,
    /// The line between them is connected.
    pub plugged: bool,
    /// What spoils the line, if anything.
    pub line: Option<Line>,
    /// Whether the byte just written arrives without its stop bit.
    pub breaks: Option<Box<dyn FnMut() -> bool>>,
    /// Messages that passed the bus, motion and status excepted.
    pub passed: Vec<Passed>,
}

impl Rig {
    /// Powered up, braked, 5 mm above the ground.
    pub fn new(pushes: &[Push]) -> Rig {
        let episode = Episode {
            index: 0,
            seed: 5,
            duration_s: 3600.0,
            settle_s: 0.5,
            drop_m: 0.005,
            pushes: pushes.to_vec(),
            direction: None,
        };
        let mut robot = Emulated::new(&SilConfig::default(), &images(), &episode).expect("a valid configuration");
        robot.can_mut().record(true);
        Rig {
            robot,
            session: HostSession::new(7),
            news: vec![],
            telemetry: Telemetry::default(),
            events: vec![],
            tap: Deframer::new(),
            plugged: true,
            line: None,
            breaks: None,
            passed: vec![],
        }
    }

    /// Powered up and armed.
    pub fn armed(pushes: &[Push]) -> Rig {
        let mut rig = Rig::new(pushes);
        rig.arm(READY_MS);
        rig
    }

    /// Armed and pushed, in the retraction of the step that follows; `later` pushes are still to come.
    pub fn mid_step(later: &[Push]) -> Rig {
        let mut rig = Rig::armed(&[&[step_push()], later].concat());
        rig.wait(STEP_MS, "the push makes it step", |rig| rig.phase() == Phase::Retract as u8);
        assert_ne!(rig.node(NodeId::Knee), BRAKED);
        rig
    }

    /// As [`Rig::mid_step`], a little later: a hip is under way too.
    pub fn mid_swing(later: &[Push]) -> Rig {
        let mut rig = Rig::mid_step(later);
        rig.wait(STEP_MS, "a hip swings", |rig| rig.node(NodeId::Hip) != BRAKED);
        assert_ne!(rig.node(NodeId::Knee), BRAKED);
        rig
    }

    /// Arms, however often it takes.
    pub fn arm(&mut self, limit_ms: u64) {
        let mut asked = None;
        for _ in 0..limit_ms {
            // A robot that is not ready, or has rebooted, is asked again.
            let not_yet =
                |news: &News| matches!(news, News::Refused(Command::Arm { .. }, Refusal::NotReady(_)) | News::Rebooted);
            if asked.is_none_or(|at: usize| self.news[at..].iter().any(not_yet)) {
                asked = self.session.arm().is_ok().then_some(self.news.len());
            }
            self.step();
            if self.telemetry.mode == Mode::Armed {
                return;
            }
        }
        panic!("not armed within {limit_ms} ms: {:?}, {:?}", self.telemetry, self.news);
    }

    /// One millisecond of the robot and of the line.
    pub fn step(&mut self) {
        self.send();
        self.run_to(self.now_us() + 1000);
        self.receive();
    }

    /// Robot and chips alone, to this time.
    fn run_to(&mut self, until_us: u64) {
        let health = self.robot.run_until(until_us).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(health, Health::Upright, "at {} µs", self.now_us());
        for record in self.robot.can_mut().take_log().into_iter().filter(|record| record.error.is_none()) {
            let data = record.frame.data[..usize::from(record.frame.length)].iter().copied().collect();
            let message = Message::decode(&Frame { id: record.frame.id as u16, data }).expect("all speak one tongue");
            if !matches!(message, Message::Motion(_) | Message::Status(..)) {
                self.passed.push(Passed { at: record.end, message });
            }
        }
    }

    fn send(&mut self) {
        let now_us = self.now_us();
        while self.plugged
            && let Some(bytes) = self.session.poll(now_us)
        {
            let bytes = self.through_the_line(&bytes);
            self.robot.host_write(&bytes);
            if self.breaks.as_mut().is_some_and(|breaks| breaks())
                && let Serial::Uart(uart) = &mut self.robot.chips_mut()[COORDINATOR].wires_mut().serial[HOST_SERCOM]
                && let Some(byte) = uart.to_chip.back_mut()
            {
                byte.framing_error = true;
            }
        }
    }

    fn receive(&mut self) {
        let bytes = self.robot.host_read();
        for byte in &bytes {
            match self.tap.push(*byte).and_then(|packet| ToHost::decode(&packet.ok()?).ok()) {
                Some(ToHost::Report(Report::Telemetry(telemetry))) => self.telemetry = telemetry,
                Some(ToHost::Report(Report::Event { event, .. })) => self.events.push(event),
                _ => {}
            }
        }
        if !self.plugged {
            return;
        }
        let bytes = self.through_the_line(&bytes);
        let news = &mut self.news;
        self.session.on_bytes(self.robot.now_us(), &bytes, &mut |item| {
            if !matches!(item, News::Telemetry(_) | News::Event { .. }) {
                news.push(item);
            }
        });
    }

    fn through_the_line(&mut self, bytes: &[u8]) -> Vec<u8> {
        match &mut self.line {
            Some(line) => line(bytes),
            None => bytes.to_vec(),
        }
    }

    /// `millis` steps.
    pub fn run_ms(&mut self, millis: u64) {
        (0..millis).for_each(|_| self.step());
    }

    /// Steps to this time.
    pub fn run_until_ms(&mut self, at_ms: u64) {
        while self.now_us() < at_ms * 1000 {
            self.step();
        }
    }

    /// Steps until `condition` holds; how long it took, ms.
    pub fn wait(&mut self, limit_ms: u64, what: &str, mut condition: impl FnMut(&Rig) -> bool) -> u64 {
        for millis in 0..=limit_ms {
            if condition(self) {
                return millis;
            }
            self.step();
        }
        panic!("not within {limit_ms} ms: {what}; {:?}, {:?}", self.telemetry, self.events);
    }

    /// For `millis` no brake is released for a tenth of a millisecond, nor a joint moved.
    pub fn stays_braked(&mut self, millis: u64) {
        let begin = self.passed.len();
        for _ in 0..millis {
            self.send();
            for _ in 0..10 {
                self.run_to(self.now_us() + 100);
                assert!(self.is_braked(), "at {} µs: {:?}", self.now_us(), self.pins());
            }
            self.receive();
            assert!(Joint::ALL.iter().all(|joint| self.robot.body().robot().driven(*joint) == Drive::Brake));
        }
        let starts =
            |passed: &Passed| matches!(passed.message, Message::Gait(gait) if gait.event == GaitEvent::CycleStart);
        assert!(!self.passed[begin..].iter().any(starts), "a cycle began");
    }

    /// Braked for `millis`, armed anew, and still a robot that answers its last push with a step.
    pub fn moves_only_when_armed_anew(&mut self, millis: u64) {
        self.stays_braked(millis);
        assert_eq!(self.telemetry.mode, Mode::Braked);
        self.arm(1000);
        let last = self.robot.body().episode().pushes.iter().map(|push| (push.at_s * 1e6) as u64).max();
        let left_us = last.and_then(|last| last.checked_sub(self.now_us())).expect("the last push is still to come");
        let steps = self.telemetry.steps;
        self.wait(left_us / 1000 + STEP_MS, "steps again", |rig| rig.telemetry.steps > steps);
    }

    /// Whether the robot said so.
    pub fn said(&self, event: Event) -> bool {
        self.events.contains(&event)
    }

    /// Time line, µs since power-up.
    pub fn now_us(&self) -> u64 {
        self.robot.now_us()
    }

    /// Phase of the knee, as telemetry has it.
    pub fn phase(&self) -> u8 {
        self.telemetry.phases[0]
    }

    /// What the pins of a node say.
    pub fn node(&self, id: NodeId) -> [Pins; 2] {
        self.robot.commands(id)
    }

    /// What the pins of all nodes say.
    pub fn pins(&self) -> [[Pins; 2]; 3] {
        NodeId::ALL.map(|id| self.node(id))
    }

    /// Whether all six brakes are engaged.
    pub fn is_braked(&self) -> bool {
        self.pins() == [BRAKED; 3]
    }

    /// The generation of a set that is in force from now on.
    pub fn apply(&mut self, set: &ParamSet) -> u32 {
        self.session.apply(set).expect("nothing under way");
        let begin = self.news.len();
        let applied = |news: &News| if let News::Applied { generation, .. } = news { Some(*generation) } else { None };
        self.wait(3000, "applied", |rig| rig.news[begin..].iter().any(|news| applied(news).is_some()));
        self.news[begin..].iter().find_map(applied).expect("it was there")
    }

    /// A set that the robot holds.
    pub fn ask(&mut self, which: Which) -> ParamSet {
        self.session.get_params(which).expect("connected");
        let answer = |news: &News| match news {
            News::Params(ParamsReport { which: about, params: Some(params), .. }) if *about == which => Some(*params),
            _ => None,
        };
        let begin = self.news.len();
        self.wait(1000, "an answer", |rig| rig.news[begin..].iter().any(|news| answer(news).is_some()));
        let params = self.news[begin..].iter().find_map(answer).expect("it was there");
        ParamSet::new(params).expect("whole sets only")
    }
}
