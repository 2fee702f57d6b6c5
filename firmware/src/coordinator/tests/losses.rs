//! The three losses, and the faults.

use super::*;

#[test]
fn motion_starts_braked_and_only_an_explicit_arm_changes_that() {
    let mut rig = Rig::new(config());
    rig.run(3_000);
    assert!(!rig.moving());
    assert_eq!(rig.telemetry().mode, Mode::Braked);
    rig.session.arm().expect("connected");
    rig.run(50);
    assert!(rig.moving());
    assert!(rig.events().contains(&Event::Armed));
}

#[test]
fn arming_needs_the_imu_all_nodes_and_one_generation() {
    let mut rig = Rig::new(config());
    rig.imu = false;
    rig.run(400);
    rig.session.arm().expect("connected");
    rig.run(50);
    rig.imu = true;
    rig.nodes[1].mute = true;
    rig.run(600);
    rig.session.arm().expect("connected");
    rig.run(50);
    use sarah_protocol::host::NotReady;
    assert_eq!(rig.refusals(), [Refusal::NotReady(NotReady::Imu), Refusal::NotReady(NotReady::Node(NodeId::Hip))]);
    assert!(!rig.moving());
}

#[test]
fn arming_for_another_boot_is_refused_by_name() {
    let mut rig = Rig::new(config());
    rig.run(600);
    rig.command(1, 900, Command::Arm { boot_nonce: 1 });
    assert_eq!(rig.acks(), [AckState::Refused(Refusal::Rebooted { current: NONCE })]);
    assert_eq!(rig.coordinator.mode(), Mode::Braked);
}

#[test]
fn an_unattended_robot_arms_itself_once_when_told_so_at_build_time() {
    let mut rig = Rig::new(Config { arm_at_boot: true, ..config() });
    rig.host_connected = false;
    rig.run(1_000);
    assert!(rig.moving());
    rig.imu = false;
    rig.run(200);
    rig.imu = true;
    rig.run(2_000);
    assert!(!rig.moving(), "after a halt only a host resumes");
}

#[test]
fn with_no_host_the_robot_runs_its_stored_set() {
    let mut rig = Rig::new(Config { arm_at_boot: true, stored: other_set(0.1), ..config() });
    rig.host_connected = false;
    rig.run(1_000);
    assert_eq!(rig.applied_everywhere(), Some((1, other_set(0.1))));
    assert!(rig.moving());
    assert!(!rig.telemetry().stale);
}

#[test]
fn a_silent_host_leaves_motion_and_set_flags_them_stale_then_the_stored_set_returns() {
    let mut rig = Rig::armed(config());
    let generation = rig.session.apply(&other_set(0.2)).expect("free");
    rig.run(200);
    assert_eq!(rig.applied_everywhere(), Some((generation, other_set(0.2))));
    rig.host_connected = false;
    rig.run(1_000);
    assert!(!rig.telemetry().stale && rig.moving());
    rig.run(2_000);
    assert!(rig.telemetry().stale && rig.moving());
    assert_eq!(rig.applied_everywhere(), Some((generation, other_set(0.2))));
    rig.run(7_000);
    assert_eq!(rig.applied_everywhere(), Some((generation + 1, default_set())));
    assert!(!rig.telemetry().stale && rig.moving());
}

#[test]
fn the_fall_back_waits_for_a_cycle_boundary() {
    let mut rig = Rig::armed(config());
    let generation = rig.session.apply(&other_set(0.2)).expect("free");
    rig.run(200);
    rig.host_connected = false;
    rig.run(9_000);
    rig.nodes[0].in_cycle = true;
    rig.run(2_000);
    assert_eq!(rig.applied_everywhere(), Some((generation, other_set(0.2))));
    rig.nodes[0].in_cycle = false;
    rig.run(100);
    assert_eq!(rig.applied_everywhere(), Some((generation + 1, default_set())));
}

#[test]
fn a_host_that_returns_carries_on_after_the_fall_back() {
    let mut rig = Rig::armed(config());
    rig.session.apply(&other_set(0.2)).expect("free");
    rig.run(200);
    rig.host_connected = false;
    rig.run(12_000);
    rig.host_connected = true;
    rig.run(1_000);
    let generation = rig.session.apply(&other_set(-0.1)).expect("free");
    rig.run(400);
    assert_eq!(rig.applied_everywhere(), Some((generation, other_set(-0.1))));
}

#[test]
fn silence_of_hours_does_not_look_like_a_moment_when_the_clock_wraps() {
    let mut rig = Rig::armed(config());
    rig.session.apply(&other_set(0.2)).expect("free");
    rig.run(200);
    rig.host_connected = false;
    rig.run(2_500);
    assert!(rig.telemetry().stale);
    // 71.6 minutes in steps that keep IMU and nodes alive would take long: jump just below a whole turn twice.
    let mut ages = rig.coordinator.clone();
    for _ in 0..2 {
        rig.now = rig.now.wrapping_add(0x7fff_ffff);
        ages.tick(rig.now, &mut rig.bus, &mut rig.host);
    }
    assert!(ages.telemetry().faults & faults::NODE_LOST != 0);
    assert_eq!(ages.mode(), Mode::Braked);
}

#[test]
fn an_imu_that_stops_leaves_time_for_the_cycle_then_halts_and_needs_a_new_arm() {
    let mut rig = Rig::armed(config());
    rig.imu = false;
    rig.run(60);
    assert!(rig.telemetry().faults & faults::IMU_LOST != 0);
    assert_eq!(rig.coordinator.mode(), Mode::Braked);
    rig.run(1_000);
    assert!(rig.nodes.iter().all(|node| node.halts.is_empty()), "the cycle may end");
    rig.run(200);
    assert!(!rig.moving());
    assert!(rig.nodes.iter().all(|node| node.halts.first() == Some(&HaltReason::ImuLost)));
    rig.imu = true;
    rig.run(1_000);
    assert!(!rig.moving());
    assert!(rig.events().contains(&Event::ImuBack));
    rig.session.arm().expect("connected");
    rig.run(50);
    assert!(rig.moving());
}

#[test]
fn an_emergency_stop_does_not_wait_for_the_cycle_of_a_lost_imu() {
    let mut rig = Rig::armed(config());
    rig.imu = false;
    rig.run(100);
    rig.session.e_stop();
    rig.run(20);
    assert!(rig.nodes.iter().all(|node| node.halts.first() == Some(&HaltReason::EmergencyStop)));
}

#[test]
fn a_node_silent_for_a_tenth_of_a_second_halts_the_others() {
    let mut rig = Rig::armed(config());
    rig.nodes[2].mute = true;
    rig.run(90);
    assert!(rig.nodes[0].moving());
    rig.run(30);
    assert!(!rig.nodes[0].moving() && !rig.nodes[1].moving());
    assert!(rig.events().contains(&Event::NodeLost(NodeId::Abductor)));
    assert!(rig.events().contains(&Event::Halted(HaltReason::NodeFault)));
    rig.nodes[2].mute = false;
    rig.run(1_000);
    assert!(!rig.moving());
    rig.session.arm().expect("connected");
    rig.run(50);
    assert!(rig.moving());
}

#[test]
fn a_restarted_node_halts_and_gets_the_applied_set_back() {
    let mut rig = Rig::armed(config());
    rig.session.apply(&other_set(0.2)).expect("free");
    rig.run(200);
    rig.nodes[1].restart();
    rig.run(20);
    assert!(!rig.moving());
    assert!(rig.events().contains(&Event::NodeRestarted(NodeId::Hip)));
    rig.run(500);
    let (generation, set) = rig.applied_everywhere().expect("one generation");
    assert_eq!((generation, set), (2, other_set(0.2)));
    assert!(!rig.moving());
    rig.session.arm().expect("connected");
    rig.run(50);
    assert!(rig.moving());
    // It is still the host's: with the host gone it gives way to the stored one.
    rig.host_connected = false;
    rig.run(3_000);
    assert!(rig.telemetry().stale);
    rig.run(9_000);
    assert_eq!(rig.applied_everywhere().map(|(_, set)| set), Some(default_set()));
    assert!(rig.moving());
}

#[test]
fn a_node_without_positions_halts_the_robot_and_keeps_it_from_being_armed() {
    let mut rig = Rig::armed(config());
    rig.nodes[1].limits = limits::SENSOR;
    rig.run(60);
    assert!(rig.moving(), "a glitch is bridged");
    rig.run(60);
    assert!(!rig.moving());
    assert!(rig.events().contains(&Event::Halted(HaltReason::NodeFault)));
    rig.session.arm().expect("connected");
    rig.run(50);
    use sarah_protocol::host::NotReady;
    assert_eq!(rig.refusals(), [Refusal::NotReady(NotReady::Node(NodeId::Hip))]);
    rig.nodes[1].limits = 0;
    rig.run(50);
    rig.session.arm().expect("connected");
    rig.run(50);
    assert!(rig.moving());
}

#[test]
fn a_node_that_stays_halted_halts_the_others() {
    let mut rig = Rig::armed(config());
    rig.nodes[2].halted = true;
    rig.run(150);
    assert!(!rig.nodes[0].moving() && !rig.nodes[1].moving());
    rig.run(500);
    assert!(!rig.nodes.iter().any(|node| node.halted), "braked motion messages have unlatched it");
    rig.session.arm().expect("connected");
    rig.run(150);
    assert!(rig.moving());
}

#[test]
fn a_repeated_arming_does_not_undo_what_stopped_the_robot_since_the_first() {
    let mut rig = Rig::armed(config());
    let arm = Command::Arm { boot_nonce: NONCE };
    rig.command(1, 900, arm);
    rig.command(1, 901, Command::Disarm);
    rig.command(1, 900, arm);
    assert_eq!(rig.acks(), [AckState::Received; 3]);
    assert_eq!(rig.coordinator.mode(), Mode::Braked);
    rig.command(1, 902, arm);
    assert_eq!(rig.coordinator.mode(), Mode::Armed);
}

#[test]
fn a_repeated_clearance_does_not_clear_a_stop_that_came_after_the_first() {
    let mut rig = Rig::armed(config());
    rig.host_bytes(&ToRobot::EStop.encode(1, 900).expect("fits"));
    rig.command(1, 901, Command::ClearEStop);
    assert_eq!(rig.telemetry().faults & faults::E_STOP, 0);
    rig.host_bytes(&ToRobot::EStop.encode(99, 1).expect("fits"));
    rig.command(1, 901, Command::ClearEStop);
    assert_ne!(rig.telemetry().faults & faults::E_STOP, 0);
    rig.command(1, 902, Command::ClearEStop);
    assert_eq!(rig.telemetry().faults & faults::E_STOP, 0);
}

#[test]
fn a_stop_outlives_a_clearance_asked_for_before_it() {
    let mut rig = Rig::armed(config());
    rig.session.clear_e_stop().expect("connected");
    rig.session.e_stop();
    rig.run(300);
    assert_ne!(rig.telemetry().faults & faults::E_STOP, 0);
}

#[test]
fn a_stop_outlives_a_clearance_that_a_silence_swallowed() {
    let mut rig = Rig::armed(config());
    rig.session.e_stop();
    rig.run(50);
    rig.session.clear_e_stop().expect("connected");
    let lost = rig.session.poll(rig.host_us);
    assert!(lost.is_some());
    rig.host_connected = false;
    rig.run(2_000);
    rig.host_connected = true;
    rig.run(1_000);
    assert_ne!(rig.telemetry().faults & faults::E_STOP, 0, "a word from before the silence");
}

#[test]
fn the_telemetry_rate_a_host_asked_for_goes_with_it() {
    let mut rig = Rig::armed(config());
    rig.session.set_telemetry(1).expect("connected");
    rig.run(50);
    let frames = |rig: &mut Rig, millis| {
        rig.news.clear();
        rig.run(millis);
        rig.news.iter().filter(|news| matches!(news, News::Telemetry(_))).count()
    };
    assert!(frames(&mut rig, 3_000) <= 4);
    rig.host_connected = false;
    rig.run(3_000);
    rig.host_connected = true;
    rig.run(500);
    assert!(frames(&mut rig, 1_000) >= 50);
}

#[test]
fn an_emergency_stop_needs_no_claim_and_only_clear_and_arm_resume() {
    let mut rig = Rig::armed(config());
    let stop = ToRobot::EStop.encode(99, 1).expect("fits");
    rig.host_bytes(&stop);
    rig.bus_traffic();
    assert!(!rig.moving(), "at once, not with the next tick");
    rig.run(100);
    rig.session.arm().expect("connected");
    rig.run(100);
    assert_eq!(rig.refusals(), [Refusal::EStop]);
    rig.session.clear_e_stop().expect("connected");
    rig.run(500);
    assert!(!rig.moving());
    rig.session.arm().expect("connected");
    rig.run(50);
    assert!(rig.moving());
}

#[test]
fn an_emergency_stop_is_repeated_for_a_node_that_missed_it() {
    let mut rig = Rig::armed(config());
    rig.nodes[1].mute = true;
    rig.session.e_stop();
    rig.run(5);
    rig.nodes[1].mute = false;
    rig.run(110);
    assert_eq!(rig.nodes[1].halts.first(), Some(&HaltReason::EmergencyStop));
}

#[test]
fn a_disarm_brakes_at_once_even_while_a_commit_waits() {
    let mut rig = Rig::armed(config());
    rig.nodes[0].in_cycle = true;
    rig.session.apply(&other_set(0.1)).expect("free");
    rig.run(100);
    rig.session.disarm();
    rig.run(3);
    assert!(!rig.moving());
    assert!(rig.events().contains(&Event::Halted(HaltReason::Disarmed)));
}

#[test]
fn a_disarm_brakes_at_once_whatever_waits_for_its_answer() {
    let mut rig = Rig::armed(config());
    rig.session.apply(&other_set(0.1)).expect("free");
    rig.run(200);
    rig.store_hangs = true;
    rig.session.persist().expect("connected");
    rig.run(50);
    while rig.session.get_params(Which::Stored).is_ok() {}
    rig.session.disarm();
    rig.run(3);
    assert!(!rig.moving());
}

#[test]
fn a_halt_takes_back_a_motion_message_that_has_not_left() {
    let mut bus = BusOutbox::new();
    bus.motion(sarah_protocol::bus::Motion { mode: Mode::Armed, ..Default::default() });
    bus.halt(HaltReason::EmergencyStop);
    let halt = bus.pop().expect("the halt");
    assert_eq!(Message::decode(&halt), Ok(Message::Halt(HaltReason::EmergencyStop)));
    assert_eq!(bus.pop(), None);
}
