use sarah_firmware::default_params;
use sarah_protocol::bus::Mode;
use sarah_protocol::fixed::Q16;
use sarah_protocol::session::NotNow;
use sarah_sim::robot::Geometry;

use super::*;
use crate::task::action::Scope;
use crate::task::odometry::Odometry;

/// Between two telemetry frames, µs.
const FRAME_US: u64 = 10_000;

fn task() -> Task {
    Task { scope: Scope::Knee, base: ParamSet::table_ii(), reward: RewardForm::Gated, horizon: 3, episodes: 2 }
}

/// A robot that does what its fields say, and the collector that hears it.
struct Scene {
    collector: Collector,
    now_us: u64,
    frame: Telemetry,
    answers: bool,
    /// Hears an arm; otherwise the session is not open.
    hears: bool,
    held: Option<ParamSet>,
    done: Vec<Do>,
}

impl Scene {
    fn new() -> Scene {
        let mut frame = Telemetry { accel: [0, 0, 2048], loads: [800; 4], ..Telemetry::default() };
        frame.mode = Mode::Braked;
        let collector = Collector::new(
            task(),
            0,
            PoseSource::new(Odometry::new(Geometry::load().expect("the robot's description"))),
        );
        Scene { collector, now_us: 0, frame, answers: true, hears: true, held: Some(task().base), done: vec![] }
    }

    fn hear(&mut self, what: What) {
        let heard = Heard { at_us: self.now_us, what };
        self.collector.heard(&heard, &mut self.done);
    }

    /// Runs for `seconds`; what was to be done meanwhile.
    fn run(&mut self, seconds: f64) -> Vec<Do> {
        let end_us = self.now_us + (seconds * 1e6) as u64;
        let first = self.done.len();
        while self.now_us < end_us {
            self.now_us += FRAME_US;
            self.frame.time_us = self.frame.time_us.wrapping_add(FRAME_US as u32);
            let frame = self.frame;
            self.hear(What::News(News::Telemetry(frame)));
            self.tick();
        }
        self.done[first..].to_vec()
    }

    fn tick(&mut self) {
        let mut out = vec![];
        let look = self.look();
        self.collector.tick(&look, &mut out);
        for item in out {
            match &item {
                Do::Ask(Ask::Arm) if !self.hears => {
                    self.hear(What::NotNow { ask: Ask::Arm, why: NotNow::NotConnected });
                }
                Do::Ask(Ask::Params(set)) => self.held = Some(*set),
                Do::Ask(Ask::Arm) => {
                    self.frame.mode = Mode::Armed;
                    self.hear(What::News(News::Done(Command::Arm { boot_nonce: 1 })));
                }
                Do::Ask(Ask::Disarm | Ask::EStop) => self.frame.mode = Mode::Braked,
                Do::Send(seen) if self.answers => self.answer(seen),
                _ => {}
            }
            self.done.push(item);
        }
    }

    fn look(&self) -> Look {
        Look { now_us: self.now_us, open: true, held: self.held, learned: true }
    }

    fn answer(&mut self, seen: &Seen) {
        let (attempt, decision) = match seen {
            Seen::Began { attempt, .. } => (*attempt, 0),
            Seen::Went { attempt, end: None, .. } => (*attempt, self.decisions()),
            _ => return,
        };
        let act = Act { attempt, decision, action: vec![0.0; 3] };
        self.held = self.collector.act(&act);
        assert!(self.held.is_some(), "{act:?} is in time");
    }

    /// The operator types `a`; what was said to that.
    fn word(&mut self, consent: Consent) -> Vec<Do> {
        let (look, mut out) = (self.look(), vec![]);
        self.collector.word(consent, &look, &mut out);
        out
    }

    fn event(&mut self, event: Event) {
        self.hear(What::News(News::Event { time_us: 0, event }));
    }

    fn decisions(&self) -> usize {
        self.collector.acting.as_ref().map_or(0, |acting| acting.decision)
    }

    /// Forward, by 1.2 rad in half a second; then it lies for half a second.
    fn falls(&mut self) -> Vec<Do> {
        let first = self.done.len();
        self.turns(0.0, 1.2);
        self.run(0.5);
        self.done[first..].to_vec()
    }

    fn turns(&mut self, from_rad: f32, to_rad: f32) {
        let rate_rad_s = (to_rad - from_rad) / 0.5;
        for step in 1..=50 {
            let lean = from_rad + (to_rad - from_rad) * step as f32 / 50.0;
            self.frame.lean = [Q16::from_f32(lean), Q16::ZERO];
            self.frame.accel = [(-2048.0 * lean.sin()) as i16, 0, (2048.0 * lean.cos()) as i16];
            self.frame.gyro = [0, (rate_rad_s.to_degrees() * 16.4) as i16, 0];
            self.run(0.01);
        }
        self.frame.gyro = [0; 3];
    }

    /// Somebody puts it back on its feet.
    fn stands(&mut self) {
        self.turns(1.2, 0.0);
    }
}

fn sent(done: &[Do]) -> Vec<&Seen> {
    done.iter().filter_map(|item| if let Do::Send(seen) = item { Some(seen) } else { None }).collect()
}

fn asked(done: &[Do], ask: Ask) -> usize {
    done.iter().filter(|item| **item == Do::Ask(ask)).count()
}

#[test]
fn nothing_moves_and_no_episode_begins_without_a_word() {
    let mut scene = Scene::new();
    let done = scene.run(10.0);
    assert_eq!((asked(&done, Ask::Arm), sent(&done).len()), (0, 0));
    assert!(scene.collector.waiting_for(&scene.look()).contains("arm (a)"));
}

#[test]
fn an_episode_is_its_decisions_by_the_clock_and_ends_with_a_time_out() {
    let mut scene = Scene::new();
    scene.collector.allow(Consent::Once);
    let done = scene.run(5.0);
    let seen = sent(&done);
    assert!(matches!(seen[0], Seen::Began { episode: 0, .. }));
    let ends: Vec<_> = seen[1..4]
        .iter()
        .map(|seen| if let Seen::Went { end, reward, .. } = seen { (*end, *reward > 0.9) } else { panic!("{seen:?}") })
        .collect();
    assert_eq!(ends, [(None, true), (None, true), (Some(End::TimeOut), true)]);
}

#[test]
fn a_fallen_robot_waits_for_hands_and_one_that_stands_again_for_a_word() {
    let mut scene = Scene::new();
    scene.collector.allow(Consent::Once);
    scene.run(3.0);
    scene.falls();
    scene.run(1.0);
    assert!(scene.collector.waiting_for(&scene.look()).contains("back on its feet"));
    scene.stands();
    scene.run(2.0);
    assert!(scene.collector.waiting_for(&scene.look()).contains("arm (a)"));
}

#[test]
fn as_many_episodes_as_the_session_has_and_no_more() {
    let mut scene = Scene::new();
    scene.collector.allow(Consent::Once);
    let done = scene.run(30.0);
    let begun = sent(&done).iter().filter(|seen| matches!(seen, Seen::Began { .. })).count();
    assert_eq!(begun, 2);
}

#[test]
fn a_robot_that_moves_is_neither_armed_nor_begun_with() {
    let mut scene = Scene::new();
    scene.collector.allow(Consent::Once);
    scene.frame.gyro = [2000, 0, 0];
    assert_eq!(asked(&scene.run(5.0), Ask::Arm), 0);
}

#[test]
fn a_fall_ends_the_episode_brakes_and_is_armed_again_only_if_that_was_allowed() {
    for (consent, arms) in [(Consent::Once, 0), (Consent::AfterFalls, 1)] {
        let mut scene = Scene::new();
        scene.collector.allow(consent);
        scene.run(2.5);
        let done = scene.falls();
        assert!(asked(&done, Ask::Disarm) > 0, "{consent:?}");
        assert!(sent(&done).iter().any(|seen| matches!(seen, Seen::Went { end: Some(End::Fall), reward: 0.0, .. })));
        assert_eq!(asked(&done, Ask::Arm), 0, "it lies");
        scene.stands();
        assert_eq!(asked(&scene.run(3.0), Ask::Arm), arms, "{consent:?}");
    }
}

#[test]
fn a_lost_link_spoils_the_episode_and_ends_the_word() {
    let mut scene = Scene::new();
    scene.collector.allow(Consent::AfterFalls);
    scene.run(2.5);
    scene.hear(What::Down { why: "pulled".into() });
    assert!(scene.done.contains(&Do::Send(Seen::Spoilt { attempt: 1 })));
    // It balanced on, so training does too; but a fall now needs a word.
    assert!(sent(&scene.run(3.0)).iter().any(|seen| matches!(seen, Seen::Began { episode: 0, .. })));
    scene.falls();
    scene.stands();
    assert_eq!(asked(&scene.run(5.0), Ask::Arm), 0);
}

#[test]
fn brakes_that_nobody_asked_for_end_the_word() {
    let mut scene = Scene::new();
    scene.collector.allow(Consent::AfterFalls);
    scene.run(2.5);
    scene.frame.mode = Mode::Braked;
    scene.event(Event::Halted(HaltReason::NodeFault));
    assert!(scene.done.contains(&Do::Send(Seen::Spoilt { attempt: 1 })));
    assert_eq!(asked(&scene.run(5.0), Ask::Arm), 0);
}

#[test]
fn an_answer_that_is_too_late_is_never_taken_for_the_next_decision_s() {
    let mut scene = Scene::new();
    scene.collector.allow(Consent::Once);
    scene.answers = false;
    let done = scene.run(2.5);
    assert!(done.contains(&Do::Send(Seen::Spoilt { attempt: 1 })));
    assert_eq!(scene.collector.counts(), Counts { spoilt: 1, late: 1 });
    assert_eq!(scene.collector.act(&Act { attempt: 1, decision: 1, action: vec![0.0; 3] }), None);
}

#[test]
fn thin_telemetry_spoils_the_episode() {
    let mut scene = Scene::new();
    scene.collector.allow(Consent::Once);
    scene.run(1.2);
    for _ in 0..4 {
        scene.now_us += 300_000;
        let frame = scene.frame;
        scene.hear(What::News(News::Telemetry(frame)));
        scene.tick();
    }
    assert!(scene.done.contains(&Do::Send(Seen::Spoilt { attempt: 1 })));
}

#[test]
fn an_action_becomes_the_session_s_parameters_and_no_others() {
    let mut scene = Scene::new();
    scene.collector.allow(Consent::Once);
    scene.answers = false;
    scene.run(1.2);
    let set = scene.collector.act(&Act { attempt: 1, decision: 0, action: vec![1.0; 3] }).expect("in time");
    assert_eq!(set.values()[3..], task().base.values()[3..]);
    assert_ne!(set, default_params());
}

#[test]
fn a_word_is_heard_only_by_a_robot_that_is_there_braked_and_not_stopped() {
    let mut scene = Scene::new();
    assert!(format!("{:?}", scene.word(Consent::Once)).contains("does not answer"));
    scene.run(0.1);
    scene.frame.faults = sarah_protocol::telemetry::faults::E_STOP;
    scene.run(0.1);
    assert!(format!("{:?}", scene.word(Consent::Once)).contains("clear it with c first"));
    scene.frame.faults = 0;
    scene.run(0.1);
    assert!(scene.word(Consent::Once).is_empty());
    assert_eq!(asked(&scene.run(2.0), Ask::Arm), 1);
    // Said once too often, it must not lie around until somebody stands the robot up again.
    assert!(format!("{:?}", scene.word(Consent::Once)).contains("armed already"));
    scene.falls();
    scene.stands();
    assert_eq!(asked(&scene.run(5.0), Ask::Arm), 0);
}

#[test]
fn a_robot_that_was_silent_is_not_armed_by_an_old_word_although_the_port_stayed_open() {
    let mut scene = Scene::new();
    scene.collector.allow(Consent::AfterFalls);
    scene.run(2.5);
    scene.falls();
    scene.now_us += 5_000_000;
    scene.tick();
    scene.stands();
    assert_eq!(asked(&scene.run(5.0), Ask::Arm), 0);
}

#[test]
fn an_arm_that_could_not_be_asked_is_asked_again() {
    let mut scene = Scene::new();
    scene.collector.allow(Consent::AfterFalls);
    scene.hears = false;
    assert!(asked(&scene.run(3.0), Ask::Arm) > 1);
    scene.hears = true;
    scene.run(1.0);
    assert_eq!(scene.frame.mode, Mode::Armed);
}

#[test]
fn a_node_that_fails_in_a_fall_ends_the_word() {
    let mut scene = Scene::new();
    scene.collector.allow(Consent::AfterFalls);
    scene.run(2.5);
    scene.falls();
    scene.event(Event::Halted(HaltReason::NodeFault));
    scene.stands();
    assert_eq!(asked(&scene.run(5.0), Ask::Arm), 0);
}

#[test]
fn brakes_that_were_not_heard_are_asked_for_again() {
    let mut scene = Scene::new();
    scene.collector.allow(Consent::Once);
    scene.run(2.5);
    scene.turns(0.0, 1.2);
    scene.frame.mode = Mode::Armed;
    let mut asks = 0;
    for _ in 0..100 {
        asks += asked(&scene.run(0.01), Ask::Disarm);
        scene.frame.mode = Mode::Armed;
    }
    assert!((3..=6).contains(&asks), "{asks} in a second");
}

#[test]
fn a_set_that_never_came_into_force_teaches_nothing() {
    let mut scene = Scene::new();
    scene.collector.allow(Consent::Once);
    scene.run(1.2);
    scene.held = Some(default_params());
    let done = scene.run(1.0);
    assert!(done.contains(&Do::Send(Seen::Spoilt { attempt: 1 })), "{done:?}");
}

#[test]
fn between_episodes_the_robot_runs_what_the_session_started_from() {
    let mut scene = Scene::new();
    scene.collector.allow(Consent::AfterFalls);
    scene.run(2.5);
    assert_ne!(scene.held, Some(task().base));
    scene.falls();
    scene.run(0.1);
    assert_eq!(scene.held, Some(task().base), "it must not be stood up with what felled it");
}
