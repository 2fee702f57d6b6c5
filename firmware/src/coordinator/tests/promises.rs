//! The promises of the protocol that need both ends.

use sarah_protocol::host::Hello;
use sarah_protocol::session::{SessionError, State};

use super::*;

#[test]
fn promise_2_a_schema_mismatch_is_a_named_error_and_nothing_else_is_said() {
    let mut session = HostSession::new(1);
    let reply = HelloReply { version: 1, schema: 7, boot_nonce: 1, ..HelloReply::default() };
    let bytes = ToHost::Hello(reply).encode(1, 1).expect("fits");
    let mut news = vec![];
    assert!(session.poll(0).is_some());
    session.on_bytes(10, &bytes, &mut |n| news.push(n));
    let State::Failed(error) = session.state() else { panic!("{:?}", session.state()) };
    assert_eq!(error, SessionError::Schema { ours: schema_hash(), theirs: 7 });
    assert!(error.to_string().contains("0x00000007"));
    assert_eq!(news, [News::Failed(error)]);
    assert!(session.poll(10_000_000).is_none());
}

#[test]
fn promise_2_a_robot_answers_a_version_it_does_not_speak_with_its_hello() {
    let mut rig = Rig::new(config());
    let header = sarah_protocol::frame::Header { version: 9, session: 5, sequence: 1 };
    let bytes = sarah_protocol::frame::encode(header, b"whatever").expect("fits");
    rig.host_bytes(&bytes);
    let Some(ToHost::Hello(hello)) = rig.said().into_iter().next() else { panic!("no hello") };
    assert_eq!((hello.version, hello.schema, hello.boot_nonce), (VERSION, schema_hash(), NONCE));
}

#[test]
fn promise_2_the_hello_tells_which_nodes_are_there() {
    let mut rig = Rig::new(config());
    rig.nodes[1].mute = true;
    rig.run(300);
    let bytes = ToRobot::Hello(Hello::ours()).encode(5, 1).expect("fits");
    rig.said();
    rig.host_bytes(&bytes);
    assert!(matches!(rig.said().first(), Some(ToHost::Hello(hello)) if hello.nodes == 0b101));
}

#[test]
fn promise_3_a_second_host_is_refused_by_name_until_the_first_lapses() {
    let mut rig = Rig::new(config());
    rig.run(200);
    rig.other = Some(HostSession::new(2));
    rig.run(3_000);
    assert!(rig.other_news.contains(&News::Refused(Command::Claim, Refusal::Claimed { by: 1 })));
    assert!(!rig.other_news.contains(&News::Claimed));
    rig.session = HostSession::observer(3);
    rig.run(2_500);
    assert!(rig.other_news.contains(&News::Claimed));
}

#[test]
fn promise_3_nothing_but_a_stop_is_heard_without_the_claim() {
    let mut rig = Rig::new(config());
    rig.host_connected = false;
    rig.run(100);
    rig.said();
    for command in [
        Command::Arm { boot_nonce: NONCE },
        Command::Disarm,
        Command::ClearEStop,
        Command::Stage { generation: 1, params: *other_set(0.1).values() },
        Command::Commit { generation: 0 },
        Command::Persist { generation: 0 },
        Command::SetTelemetry { rate_hz: 1 },
        Command::Heartbeat { host_us: 0 },
        Command::Release,
    ] {
        rig.command(4, 1, command);
        assert_eq!(rig.acks(), [AckState::Refused(Refusal::NotClaimed)], "{command:?}");
    }
}

#[test]
fn promise_3_a_power_cycle_never_resumes_motion_without_an_explicit_arm() {
    let mut rig = Rig::armed(config());
    let identity = Identity { boot_nonce: NONCE + 1, ..Identity::default() };
    rig.power_cycle(Config { identity, ..config() });
    rig.run(5_000);
    assert!(!rig.moving());
    assert!(rig.news.contains(&News::Rebooted));
    assert_eq!(rig.session.state(), State::Open);
    rig.session.arm().expect("connected");
    rig.run(50);
    assert!(rig.moving());
}

#[test]
fn promise_3_an_arming_that_waits_for_an_answer_dies_with_the_link() {
    let mut rig = Rig::new(config());
    rig.run(600);
    rig.host_connected = false;
    rig.session.arm().expect("known robot");
    // The host keeps trying while nothing gets through.
    for _ in 0..3_000 {
        rig.step();
        let _ = rig.session.poll(rig.host_us);
    }
    rig.host_connected = true;
    rig.run(3_000);
    assert!(!rig.moving());
}

#[test]
fn promise_4_a_bad_set_is_refused_with_its_field_and_nothing_changes() {
    let mut rig = Rig::armed(config());
    let mut bad = *default_set().values();
    bad[4] = 9.0;
    rig.command(1, 500, Command::Stage { generation: 1, params: bad });
    bad[4] = f32::NAN;
    rig.command(1, 501, Command::Stage { generation: 1, params: bad });
    use sarah_protocol::params::ParamError::{NotFinite, OutOfRange};
    assert_eq!(
        rig.acks(),
        [
            AckState::Refused(Refusal::Params(OutOfRange { index: 4, value: 9.0 })),
            AckState::Refused(Refusal::Params(NotFinite { index: 4 })),
        ]
    );
    rig.run(100);
    assert_eq!(rig.applied_everywhere(), Some((0, default_set())));
}

#[test]
fn promise_4_a_set_that_changes_too_fast_is_refused() {
    let mut rig = Rig::armed(config());
    let mut far = *default_set().values();
    far[7] = SPECS[7].max;
    rig.command(1, 500, Command::Stage { generation: 1, params: far });
    use sarah_protocol::params::ParamError::TooFast;
    assert!(matches!(rig.acks()[..], [AckState::Refused(Refusal::Params(TooFast { index: 7, .. }))]));
}

#[test]
fn promise_4_one_node_that_refuses_leaves_all_on_the_old_set() {
    let mut rig = Rig::armed(config());
    rig.nodes[2].refuse = true;
    rig.session.apply(&other_set(0.1)).expect("free");
    rig.run(300);
    assert!(matches!(rig.refusals()[..], [Refusal::Node(NodeId::Abductor, _)]));
    assert_eq!(rig.applied_everywhere(), Some((0, default_set())));
    assert!(rig.moving());
}

#[test]
fn promise_5_the_swap_waits_for_the_cycle_boundary() {
    let mut rig = Rig::armed(config());
    rig.nodes[0].in_cycle = true;
    let generation = rig.session.apply(&other_set(0.1)).expect("free");
    rig.run(800);
    assert!(rig.news.contains(&News::Staged(generation)));
    assert_eq!(rig.applied_everywhere(), Some((0, default_set())));
    rig.nodes[0].cycle = 41;
    rig.nodes[0].in_cycle = false;
    rig.run(100);
    assert_eq!(rig.applied_everywhere(), Some((generation, other_set(0.1))));
    assert!(rig.news.contains(&News::Applied { generation, cycle: 41 }));
    assert_eq!(rig.seen, [[0; 3], [generation; 3]], "all in the same millisecond");
}

#[test]
fn promise_5_a_node_that_stays_behind_halts_the_robot_and_the_old_set_returns() {
    let mut rig = Rig::armed(config());
    rig.nodes[1].deaf_to_boundary = true;
    rig.session.apply(&other_set(0.1)).expect("free");
    rig.run(600);
    assert!(!rig.moving());
    assert!(rig.events().contains(&Event::GenerationSplit(NodeId::Hip)));
    rig.nodes[1].deaf_to_boundary = false;
    rig.run(1_500);
    assert!(matches!(rig.applied_everywhere(), Some((_, set)) if set == default_set()));
}

#[test]
fn promise_6_received_staged_applied_and_persisted_are_told_apart() {
    let mut rig = Rig::armed(config());
    rig.said();
    rig.host_connected = false;
    let params = *other_set(0.1).values();
    rig.command(1, 700, Command::Stage { generation: 5, params });
    assert_eq!(rig.acks(), [AckState::Received]);
    rig.run(30);
    assert_eq!(rig.acks(), [AckState::Staged { generation: 5 }]);
    rig.command(1, 701, Command::Persist { generation: 5 });
    assert_eq!(rig.acks(), [AckState::Refused(Refusal::NotApplied { applied: 0 })]);
    rig.command(1, 702, Command::Commit { generation: 5 });
    assert_eq!(rig.acks(), [AckState::Received]);
    rig.run(60);
    assert_eq!(rig.acks(), [AckState::Applied { generation: 5, cycle: 0 }]);
    assert_eq!(rig.stored, None);
    rig.command(1, 703, Command::Persist { generation: 5 });
    rig.run(2);
    assert_eq!(rig.acks(), [AckState::Received, AckState::Persisted { generation: 5 }]);
    assert_eq!(rig.stored, Some((other_set(0.1), 5)));
}

#[test]
fn promise_6_a_failed_write_is_not_persisted() {
    let mut rig = Rig::armed(config());
    rig.store_works = false;
    rig.session.apply(&other_set(0.1)).expect("free");
    rig.run(200);
    rig.session.persist().expect("connected");
    rig.run(50);
    assert_eq!(rig.refusals(), [Refusal::Storage]);
    assert_eq!(rig.session.persisted(), None);
}

#[test]
fn promise_6_telemetry_carries_generation_cycle_and_age() {
    let mut rig = Rig::armed(config());
    let generation = rig.session.apply(&other_set(0.1)).expect("free");
    rig.nodes[0].cycle = 7;
    rig.run(1_200);
    let last = rig.news.iter().rev().find_map(|n| if let News::Telemetry(t) = n { Some(*t) } else { None });
    let last = last.expect("telemetry");
    assert_eq!((last.generation, last.cycle), (generation, 7));
    assert!((1_000..1_200).contains(&last.generation_age_ms), "{}", last.generation_age_ms);
}

#[test]
fn promise_7_every_request_may_be_repeated() {
    let mut rig = Rig::armed(config());
    rig.said();
    rig.host_connected = false;
    let stage = Command::Stage { generation: 5, params: *other_set(0.1).values() };
    for _ in 0..3 {
        rig.command(1, 700, stage);
    }
    assert_eq!(rig.acks(), [AckState::Received; 3]);
    rig.run(30);
    assert_eq!(rig.acks(), [AckState::Staged { generation: 5 }]);
    rig.command(1, 700, stage);
    assert_eq!(rig.acks(), [AckState::Staged { generation: 5 }]);
    for _ in 0..3 {
        rig.command(1, 701, Command::Commit { generation: 5 });
    }
    rig.run(60);
    assert_eq!(rig.acks().last(), Some(&AckState::Applied { generation: 5, cycle: 0 }));
    rig.command(1, 701, Command::Commit { generation: 5 });
    rig.command(1, 700, stage);
    assert_eq!(rig.acks(), [AckState::Applied { generation: 5, cycle: 0 }; 2]);
    assert_eq!(rig.seen, [[0; 3], [5; 3]]);
}

#[test]
fn promise_7_stale_and_duplicate_generations_are_refused() {
    let mut rig = Rig::armed(config());
    rig.host_connected = false;
    rig.said();
    let stage = |generation, by| Command::Stage { generation, params: *other_set(by).values() };
    rig.command(1, 1, stage(5, 0.1));
    rig.command(1, 2, stage(5, 0.2));
    rig.command(1, 3, stage(4, 0.1));
    rig.command(1, 4, Command::Commit { generation: 9 });
    rig.command(1, 5, Command::Commit { generation: 3 });
    assert_eq!(
        rig.acks(),
        [
            AckState::Received,
            AckState::Refused(Refusal::Duplicate(5)),
            AckState::Refused(Refusal::Stale { newest: 5 }),
            AckState::Refused(Refusal::NotStaged(9)),
            AckState::Refused(Refusal::Stale { newest: 5 }),
        ]
    );
}

#[test]
fn promise_7_generations_wrap_around() {
    let mut rig = Rig::armed(config());
    rig.host_connected = false;
    for (n, generation) in [0x7fff_ffff, 0xffff_fffe, u32::MAX, 0, 1].into_iter().enumerate() {
        let params = *other_set(0.01 * (n + 1) as f32).values();
        rig.command(1, 1, Command::Stage { generation, params });
        rig.run(30);
        rig.command(1, 2, Command::Commit { generation });
        rig.run(60);
        assert_eq!(rig.applied_everywhere().map(|a| a.0), Some(generation), "{:?}", rig.acks());
    }
}

#[test]
fn promise_7_a_lossy_link_applies_every_change_exactly_once() {
    for lossy in 2..9 {
        let mut rig = Rig::armed(config());
        rig.lossy = lossy;
        let mut expected = vec![[0; 3]];
        for n in 1..=5 {
            let generation = rig.session.apply(&other_set(0.02 * n as f32)).expect("free");
            for _ in 0..3_000 {
                rig.step();
                if rig.session.changing().is_none() {
                    break;
                }
            }
            expected.push([generation; 3]);
            assert_eq!(rig.session.changing(), None, "one frame in {lossy} lost: {:?}", rig.refusals());
        }
        assert_eq!(rig.seen, expected, "one frame in {lossy} lost");
    }
}

#[test]
fn promise_7_a_host_that_knows_no_generation_catches_up() {
    let mut rig = Rig::armed(config());
    for _ in 0..3 {
        rig.session.apply(&other_set(0.1)).expect("free");
        rig.run(200);
    }
    rig.session = HostSession::new(1);
    let first = rig.session.apply(&other_set(0.15)).expect("free");
    assert_eq!(first, 1);
    rig.run(500);
    assert_eq!(rig.applied_everywhere(), Some((4, other_set(0.15))));
}

#[test]
fn promise_9_a_flood_of_bytes_neither_delays_nor_drops_motion_or_a_halt() {
    let mut rig = Rig::armed(config());
    let stage = Command::Stage { generation: 5, params: *other_set(0.1).values() };
    let flood: Vec<u8> = (0..40).flat_map(|n| ToRobot::Command(stage).encode(1, n).expect("fits")).collect();
    for _ in 0..20 {
        rig.now = rig.now.wrapping_add(1_000);
        rig.host_bytes(&flood);
        rig.coordinator.tick(rig.now, &mut rig.bus, &mut rig.host);
        rig.coordinator.on_imu(rig.now, &ImuSample { accel: [0, 0, 2048], gyro: [0; 3] }, &mut rig.bus);
    }
    rig.host_bytes(&ToRobot::EStop.encode(1, 99).expect("fits"));
    let first = rig.bus.pop().expect("the halt first");
    assert_eq!(Message::decode(&first), Ok(Message::Halt(HaltReason::EmergencyStop)));
}

#[test]
fn promise_9_replies_go_before_telemetry_and_only_telemetry_is_dropped() {
    let mut rig = Rig::armed(config());
    rig.host_connected = false;
    rig.said();
    rig.run(100);
    rig.command(1, 50, Command::Heartbeat { host_us: 0 });
    let said = rig.said();
    assert!(matches!(said[0], ToHost::Report(Report::Ack(_))), "{said:?}");
    assert!(matches!(said[1], ToHost::Report(Report::Telemetry(_))));
    assert_eq!(said.len(), 2);
    assert!(rig.telemetry().dropped >= 8);
}

#[test]
fn the_three_sets_can_be_read() {
    let mut rig = Rig::armed(config());
    rig.nodes[0].in_cycle = true;
    rig.session.apply(&other_set(0.1)).expect("free");
    rig.run(100);
    for which in [Which::Applied, Which::Stored, Which::Staged] {
        rig.session.get_params(which).expect("connected");
    }
    rig.run(100);
    let sets: Vec<_> = rig
        .news
        .iter()
        .filter_map(|n| if let News::Params(p) = n { Some((p.which, p.params)) } else { None })
        .collect();
    assert_eq!(
        sets,
        [
            (Which::Applied, Some(*default_set().values())),
            (Which::Stored, Some(*default_set().values())),
            (Which::Staged, Some(*other_set(0.1).values())),
        ]
    );
}

#[test]
fn telemetry_comes_at_the_rate_asked_for() {
    let mut rig = Rig::armed(config());
    for (rate_hz, expected) in [(100, 99..=101), (50, 49..=51), (0, 0..=1)] {
        rig.session.set_telemetry(rate_hz).expect("connected");
        rig.run(20);
        rig.news.clear();
        rig.run(1_000);
        let count = rig.news.iter().filter(|n| matches!(n, News::Telemetry(_))).count();
        assert!(expected.contains(&count), "{rate_hz} Hz: {count}");
    }
}

#[test]
fn the_link_statistics_count_what_is_lost() {
    let mut rig = Rig::armed(config());
    assert_eq!(rig.session.stats().lost, 0);
    rig.lossy = 10;
    rig.run(2_000);
    let stats = rig.session.stats();
    assert!((10..40).contains(&stats.lost), "{stats:?}");
    assert_eq!(stats.frame_errors, 0);
    assert!(rig.robot().is_some());
}
