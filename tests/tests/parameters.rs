//! Parameter sets on their way from a host into a moving robot: whole, at a boundary, everywhere or nowhere.

use std::collections::{HashMap, HashSet};

use sarah_firmware::lpg::Drive;
use sarah_firmware::lpg::knee::Phase;
use sarah_firmware::lpg::rules;
use sarah_firmware::{default_params, lpg::knee::KneeParams, lpg::swing::SwingParams};
use sarah_protocol::bus::{Mode, NodeId, Side};
use sarah_protocol::frame::Deframer;
use sarah_protocol::host::{Ack, AckState, Command, Refusal, Report, ToHost, ToRobot};
use sarah_protocol::params::{Lpg, ParamError, ParamSet, SPECS};
use sarah_protocol::session::{News, State};
use sarah_protocol::telemetry::faults;
use sarah_sim::body::joints_of;
use sarah_sim::bus::Station;
use sarah_sim::line::{Faults, Line};
use sarah_sim::robot::{Health, Joint};
use sarah_sim::scenario::Push;
use sarah_sim::sil::{Sil, SilConfig};
use sarah_tests::{Bench, Dice, episode, generations, near_default, push};

/// A push every two seconds, all around.
fn pushes(impulse_n_s: f32) -> Vec<Push> {
    (0..8).map(|n| push(1.5 + 2.0 * n as f32, impulse_n_s, 45.0 * n as f32)).collect()
}

/// Sets a host asked for, by the generation they went under.
struct Sent {
    sets: HashMap<u32, ParamSet>,
    count: u32,
    read: usize,
}

impl Sent {
    fn new() -> Sent {
        Sent { sets: HashMap::from([(0, default_params())]), count: 0, read: 0 }
    }

    /// Asks for a new set whenever none is under way; follows renumbering.
    fn flood(&mut self, bench: &mut Bench) {
        for news in &bench.news[self.read..] {
            if let News::Renumbered { from, to } = *news {
                self.sets.insert(to, self.sets[&from]);
            }
        }
        self.read = bench.news.len();
        // No two alike, and every value of each differs from its neighbours'.
        let set = near_default(0.0004 * (1 + self.count % 50) as f32);
        if let Ok(generation) = bench.session.apply(&set) {
            self.sets.insert(generation, set);
            self.count += 1;
        }
    }
}

/// Asserts that every moving joint moves at a speed of this set.
fn speeds_are_of(bench: &Bench, set: &ParamSet) {
    let commands = bench.sil.commands();
    let moving = |joint: Joint| match commands[joint as usize] {
        Drive::Velocity(speed) => Some(speed),
        Drive::Brake => None,
    };
    let knee = KneeParams::from(set);
    for speed in joints_of(NodeId::Knee).into_iter().filter_map(moving) {
        let expected = match bench.knee().lpg().phase() {
            Phase::Kick => vec![knee.kick],
            Phase::Retract => vec![-knee.retract],
            Phase::Extend => {
                vec![knee.extend, rules::KNEE.touchdown_speed.min(knee.extend), rules::KNEE.straighten]
            }
            Phase::Idle => vec![],
        };
        assert!(expected.contains(&speed), "{speed:?} is none of {expected:?}");
    }
    let swing = bench.knee().lpg().swing();
    for (id, lpg, rules) in [(NodeId::Hip, Lpg::Hip, rules::HIP), (NodeId::Abductor, Lpg::Abductor, rules::ABDUCTOR)] {
        let expected = SwingParams::of(set, lpg).expect("a swing generator").speed;
        for (side, joint) in Side::BOTH.into_iter().zip(joints_of(id)) {
            // The leg that carries turns at a speed of the rules, which no set changes.
            let expected = if side == swing { expected } else { rules.scissor_speed };
            if let Some(speed) = moving(joint) {
                assert_eq!(speed.abs(), expected, "{joint:?}");
            }
        }
    }
}

#[test]
fn parameters_never_change_inside_a_cycle_and_all_nodes_change_in_the_same_one() {
    let (mut cycles, mut generations_walked, mut sets) = (0, 0, 0);
    for seed in 21..25 {
        let mut bench = Bench::armed(&SilConfig::default(), &episode(seed, &pushes(18.0)));
        let mut sent = Sent::new();
        let mut running: Option<(u32, u32)> = None;
        let mut walked = HashSet::new();
        // A robot that falls under its eighth push has kept the promise as well.
        while bench.sil.now_us() < 17_000_000 && bench.health == Health::Upright {
            sent.flood(&mut bench);
            bench.step();
            if !bench.in_cycle() {
                running = None;
                continue;
            }
            let [knee, hip, abductor] = generations(&bench.sil);
            assert!(knee == hip && hip == abductor, "{knee} {hip} {abductor} at {} µs", bench.sil.now_us());
            let now = (bench.knee().lpg().cycle(), knee);
            match running.filter(|before| before.0 == now.0) {
                Some(before) => assert_eq!(before.1, now.1, "changed inside cycle {}", now.0),
                None => cycles += 1,
            }
            running = Some(now);
            walked.insert(knee);
            speeds_are_of(&bench, &sent.sets[&knee]);
        }
        assert_eq!(bench.mode(), Mode::Armed, "{:?}", bench.events());
        generations_walked += walked.len();
        sets += sent.count;
    }
    assert!(cycles >= 40 && generations_walked >= 20, "{cycles} cycles under {generations_walked} generations");
    assert!(sets >= 500, "{sets} sets");
}

#[test]
fn a_node_that_misses_the_activation_stops_the_robot_and_no_mixture_walks() {
    let mut bench = Bench::armed(&SilConfig::default(), &episode(2, &[push(3.0, 12.0, 0.0)]));
    let set = near_default(0.01);
    let generation = bench.session.apply(&set).expect("nothing under way");
    bench.wait(500, |bench| bench.news.contains(&News::Staged(generation))).expect("staged");
    bench.sil.unplug(Station::Node(NodeId::Abductor), true);
    bench.wait(500, |bench| bench.mode() == Mode::Braked).expect("its silence halts");
    bench.sil.unplug(Station::Node(NodeId::Abductor), false);
    bench
        .wait(3000, |bench| {
            let [knee, hip, abductor] = generations(&bench.sil);
            knee == hip && hip == abductor && bench.sil.coordinator().applied().0 == knee
        })
        .expect("one generation again");
    bench.run_until_ms(5000);
    assert_eq!((bench.mode(), bench.steps()), (Mode::Braked, 0));
    let applied = *bench.sil.coordinator().applied().1;
    assert!(applied == set || applied == default_params());
    bench.session.arm().expect("connected");
    bench.wait(1000, |bench| bench.mode() == Mode::Armed).expect("ready to arm");
    assert_eq!(bench.sil.coordinator().telemetry().faults & faults::GENERATION_SPLIT, 0);
}

#[test]
fn over_a_noisy_line_every_applied_set_is_one_that_was_sent_whole_and_the_session_recovers() {
    for seed in 0..4 {
        let mut bench =
            Bench::armed(&SilConfig::default(), &episode(seed, &[push(2.0, 10.0, 0.0), push(8.0, 10.0, 0.0)]));
        let mut sent = Sent::new();
        let mut applied = HashSet::new();
        let mut dice = Dice(seed);
        let mut check = |bench: &Bench, sent: &Sent| {
            let (generation, set) = bench.sil.coordinator().applied();
            // Generation numbers may be the coordinator's own, the sets may not.
            assert!(sent.sets.values().any(|whole| whole == set), "torn: {set:?}");
            speeds_are_of(bench, &sent.sets[&generations(&bench.sil)[0]]);
            applied.insert(generation);
        };
        for ms in 0..15_000 {
            // Half a second spoiled by one byte in 200, half by one in 10, half not at all.
            let period = [200.0, 10.0, 0.0][ms / 500 % 3];
            if ms % 500 == 0 {
                bench.noise = (period > 0.0).then(|| Line::new(Faults::one_in(period), dice.roll()));
            }
            // Garbage that is no frame at all.
            if dice.once_in(300) {
                let junk: Vec<u8> = (0..dice.roll() % 400).map(|_| dice.roll() as u8).collect();
                bench.sil.host_write(&junk);
            }
            sent.flood(&mut bench);
            bench.step();
            assert_eq!(bench.health, Health::Upright, "seed {seed}");
            check(&bench, &sent);
        }
        bench.noise = None;
        // Longer than the silence after which either side starts over.
        bench.run_ms(3000);
        assert_eq!(bench.session.state(), State::Open);
        bench.wait(2000, |bench| bench.session.changing().is_none()).expect("what was under way ends");
        let set = near_default(0.03);
        bench.session.apply(&set).expect("nothing under way");
        bench.wait(2000, |bench| *bench.sil.coordinator().applied().1 == set).expect("a clean line carries it");
        assert_eq!(bench.mode(), Mode::Armed, "seed {seed}: {:?}", bench.events());
        assert!(applied.len() >= 10 && bench.sil.coordinator().frame_errors() > 50);
    }
}

/// Commands by hand, for what a session would not send.
struct ByHand {
    sil: Sil,
    sequence: u16,
}

impl ByHand {
    fn new() -> ByHand {
        let sil = Sil::new(&SilConfig::default(), default_params(), default_params(), &episode(1, &[]));
        let mut host = ByHand { sil: sil.expect("valid"), sequence: 0 };
        host.sil.run_until(500_000).expect("rapier goes on");
        host.ask(Command::Claim);
        host
    }

    /// The answers to one command within a tenth of a second.
    fn ask(&mut self, command: Command) -> Vec<AckState> {
        self.sequence += 1;
        self.sil.host_write(&ToRobot::Command(command).encode(9, self.sequence).expect("fits"));
        self.sil.host_read();
        let until_us = self.sil.now_us() + 100_000;
        self.sil.run_until(until_us).expect("rapier goes on");
        let mut deframer: Deframer = Deframer::new();
        let mut states = vec![];
        for byte in self.sil.host_read() {
            if let Some(Ok(packet)) = deframer.push(byte)
                && let Ok(ToHost::Report(Report::Ack(Ack { request, state }))) = ToHost::decode(&packet)
                && request == self.sequence
            {
                states.push(state);
            }
        }
        states
    }
}

#[test]
fn what_is_no_number_or_out_of_range_never_gets_in_and_is_refused_by_name() {
    let mut host = ByHand::new();
    for (index, spec) in SPECS.iter().enumerate() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, spec.max * 1.01, spec.min - 0.01] {
            let mut params = *default_params().values();
            params[index] = bad;
            let answers = host.ask(Command::Stage { generation: 5, params });
            let [AckState::Refused(Refusal::Params(error))] = answers[..] else { panic!("{answers:?}") };
            assert!(error.to_string().starts_with(spec.symbol), "{error}");
            let named = match error {
                ParamError::NotFinite { index } => !bad.is_finite() && usize::from(index) < SPECS.len(),
                ParamError::OutOfRange { value, .. } => value == bad,
                ParamError::TooFast { .. } => false,
            };
            assert!(named, "{bad} was refused as {error:?}");
        }
    }
    let too_fast = ParamSet::new(core::array::from_fn(|i| SPECS[i].min)).expect("in range");
    let answers = host.ask(Command::Stage { generation: 5, params: *too_fast.values() });
    assert!(matches!(answers[..], [AckState::Refused(Refusal::Params(ParamError::TooFast { .. }))]), "{answers:?}");
    assert_eq!(host.ask(Command::Commit { generation: 5 }), [AckState::Refused(Refusal::NotStaged(5))]);
    assert_eq!(generations(&host.sil), [0; 3]);
    assert_eq!(host.sil.coordinator().applied(), (0, &default_params()));
    // The number is not spent: a good set may use it.
    let answers = host.ask(Command::Stage { generation: 5, params: *near_default(0.01).values() });
    assert_eq!(answers, [AckState::Received, AckState::Staged { generation: 5 }]);
}

#[test]
fn a_persisted_set_is_the_one_the_robot_wakes_up_with() {
    let mut bench = Bench::armed(&SilConfig::default(), &episode(1, &[]));
    let set = near_default(0.02);
    let generation = bench.session.apply(&set).expect("nothing under way");
    bench.wait(1000, |bench| bench.news.iter().any(|news| matches!(news, News::Applied { .. }))).expect("applied");
    bench.session.persist().expect("connected");
    bench.wait(500, |bench| bench.news.contains(&News::Persisted(generation))).expect("persisted");
    let stored = bench.sil.stored().expect("written").1;
    assert_eq!(stored, set);

    let mut sil =
        Sil::new(&SilConfig::default(), default_params(), stored, &episode(2, &[])).expect("a valid configuration");
    sil.run_until(1_000_000).expect("rapier goes on");
    assert_eq!((generations(&sil), sil.coordinator().applied()), ([1; 3], (1, &set)));
    assert_eq!(sil.coordinator().mode(), Mode::Braked);
}

#[test]
fn an_arming_of_another_boot_is_refused() {
    let mut host = ByHand::new();
    let current = 1;
    let answers = host.ask(Command::Arm { boot_nonce: 0xdead });
    assert_eq!(answers, [AckState::Refused(Refusal::Rebooted { current })]);
    assert_eq!(host.sil.coordinator().mode(), Mode::Braked);
    assert!(host.sil.commands().iter().all(|command| *command == Drive::Brake));
    host.sil.run_until(1_500_000).expect("rapier goes on");
    assert_eq!(host.ask(Command::Arm { boot_nonce: current }), [AckState::Received]);
    assert_eq!(host.sil.coordinator().mode(), Mode::Armed);
}
