//! Who falls silent, and what the others make of it.

use sarah_firmware::default_params;
use sarah_firmware::lpg::Drive;
use sarah_firmware::lpg::knee::Phase;
use sarah_protocol::bus::{HaltReason, Mode, NodeId};
use sarah_protocol::params::{Lpg, ParamSet};
use sarah_protocol::telemetry::{Event, faults};
use sarah_sim::body::joints_of;
use sarah_sim::bus::Station;
use sarah_sim::robot::{Health, Joint};
use sarah_sim::sil::SilConfig;
use sarah_tests::{BRAKED, Bench, episode, generations, near_default, push, unattended};

/// A coordinator or node tick at 100 Hz, ms.
const TICK_MS: u64 = 10;

/// Pushed at 1.5 s and seen into the retraction of its first step, armed by a host.
fn mid_cycle() -> Bench {
    let mut bench = Bench::armed(&SilConfig::default(), &episode(5, &[push(1.5, 15.0, 0.0)]));
    bench.wait(1500, |bench| bench.knee().lpg().phase() == Phase::Retract).expect("the push makes it step");
    bench
}

/// Nothing moves for `millis`, and no cycle begins.
fn stays_braked(bench: &mut Bench, millis: u64) {
    let cycle = bench.knee().lpg().cycle();
    for _ in 0..millis {
        bench.step();
        assert_eq!(bench.sil.commands(), BRAKED, "at {} µs", bench.sil.now_us());
    }
    assert_eq!(bench.knee().lpg().cycle(), cycle);
}

/// An arming, and that it is obeyed.
fn arms_again(bench: &mut Bench) {
    bench.session.arm().expect("connected");
    bench.wait(1000, |bench| bench.mode() == Mode::Armed).expect("ready to arm");
}

#[test]
fn a_silent_host_leaves_the_robot_balancing_then_on_its_stored_set() {
    // Pushed while the set is stale, and as the stored one is due.
    let pushes = [push(8.0, 22.0, 0.0), push(12.8, 22.0, 90.0)];
    let mut bench = Bench::armed(&SilConfig::default(), &episode(9, &pushes));
    let set = near_default(0.01);
    let generation = bench.session.apply(&set).expect("nothing under way");
    bench.wait(1000, |bench| bench.sil.coordinator().applied() == (generation, &set)).expect("applied");
    bench.run_until_ms(3000);

    bench.plugged = false;
    let (mut stale_at_ms, mut back_at_ms) = (None, None);
    let mut before = (bench.in_cycle(), generations(&bench.sil)[0]);
    for ms in 1..=20_000 {
        bench.step();
        assert_eq!((bench.health, bench.mode()), (Health::Upright, Mode::Armed), "after {ms} ms");
        let (applied, telemetry) = (*bench.sil.coordinator().applied().1, bench.sil.coordinator().telemetry());
        if telemetry.stale {
            stale_at_ms.get_or_insert(ms);
            assert_eq!(applied, set, "after {ms} ms");
        }
        if applied == default_params() {
            back_at_ms.get_or_insert(ms);
        } else {
            assert_eq!(applied, set, "after {ms} ms");
        }
        let now = (bench.in_cycle(), generations(&bench.sil)[0]);
        assert!(now.1 == before.1 || !before.0 || !now.0, "swapped inside a cycle after {ms} ms");
        before = now;
    }
    let (stale_at_ms, back_at_ms) = (stale_at_ms.expect("flagged"), back_at_ms.expect("fell back"));
    // The last word of the host is at most a heartbeat old when the line goes.
    assert!((1_490..=2_010).contains(&stale_at_ms), "{stale_at_ms} ms");
    assert!((9_490..=13_000).contains(&back_at_ms), "{back_at_ms} ms");
    assert!(!bench.sil.coordinator().telemetry().stale);
    assert!(bench.steps() >= 2);
}

#[test]
fn a_host_that_returns_writes_again_without_stopping_the_robot() {
    let mut bench = Bench::armed(&SilConfig::default(), &episode(9, &[]));
    bench.plugged = false;
    bench.run_ms(5000);
    bench.plugged = true;
    bench.run_ms(2500);
    assert_eq!(bench.mode(), Mode::Armed);
    let set = near_default(0.02);
    let generation = bench.session.apply(&set).expect("nothing under way");
    bench.wait(2000, |bench| bench.sil.coordinator().applied() == (generation, &set)).expect("applied");
}

#[test]
fn without_its_coordinator_the_knee_finishes_its_cycle_to_rest_and_everything_brakes() {
    let mut bench = mid_cycle();
    let leg = Joint::ALL[joints_of(NodeId::Knee)[bench.knee().lpg().swing() as usize] as usize];
    bench.sil.unplug(Station::Coordinator, true);
    let cycle = bench.knee().lpg().cycle();
    let mut extended = false;
    for _ in 0..1500 {
        bench.step();
        extended |= bench.knee().lpg().phase() == Phase::Extend;
        if !bench.in_cycle() {
            break;
        }
    }
    assert!(extended && !bench.in_cycle());
    bench.run_ms(TICK_MS + 60);
    let rest_m = bench.sil.robot().joint(leg).position;
    assert!(rest_m.abs() < 0.03, "{rest_m} m from rest");
    stays_braked(&mut bench, 3000);
    assert_eq!((bench.knee().lpg().cycle(), bench.health), (cycle, Health::Upright));
}

#[test]
fn without_its_coordinator_a_swing_leg_brakes_where_it_is_while_the_knee_still_moves() {
    // A hip so slow that it is under way for the whole cycle.
    let mut values = *default_params().values();
    values[Lpg::Hip.range().end - 1] = 0.5;
    let set = ParamSet::new(values).expect("in range");
    let mut bench = Bench::with_set(&unattended(), set, &episode(5, &[push(1.5, 20.0, 0.0)]));
    let moving = |bench: &Bench, id| joints_of(id).iter().any(|j| bench.sil.commands()[*j as usize] != Drive::Brake);
    bench.wait(3000, |bench| moving(bench, NodeId::Hip)).expect("the push makes it step");
    bench.sil.unplug(Station::Coordinator, true);
    bench.run_ms(40);
    assert!(moving(&bench, NodeId::Hip), "still on its last motion message");
    bench.run_ms(50 - 40 + 2 * TICK_MS);
    assert!(!moving(&bench, NodeId::Hip) && moving(&bench, NodeId::Knee));
}

#[test]
fn a_coordinator_that_comes_back_after_seconds_moves_nothing_until_armed() {
    let pushes = [push(1.5, 15.0, 0.0), push(8.0, 12.0, 180.0), push(12.0, 14.0, 0.0)];
    let mut bench = Bench::armed(&SilConfig::default(), &episode(5, &pushes));
    bench.wait(1500, |bench| bench.knee().lpg().phase() == Phase::Retract).expect("the push makes it step");
    bench.sil.unplug(Station::Coordinator, true);
    bench.run_until_ms(5000);
    bench.sil.unplug(Station::Coordinator, false);
    // Over the push at 8 s.
    stays_braked(&mut bench, 6000);
    assert!(bench.events().contains(&Event::Halted(HaltReason::NodeFault)), "{:?}", bench.events());
    assert_eq!((bench.mode(), bench.health), (Mode::Braked, Health::Upright));

    let steps = bench.steps();
    arms_again(&mut bench);
    bench.run_until_ms(16_000);
    assert_eq!(bench.health, Health::Upright);
    assert!(bench.steps() > steps);
}

#[test]
fn a_gap_of_the_coordinator_shorter_than_a_nodes_silence_needs_no_arming() {
    let mut bench = Bench::armed(&unattended(), &episode(5, &[push(2.0, 15.0, 0.0)]));
    bench.sil.unplug(Station::Coordinator, true);
    bench.run_ms(70);
    bench.sil.unplug(Station::Coordinator, false);
    bench.run_until_ms(6000);
    assert_eq!((bench.mode(), bench.health), (Mode::Armed, Health::Upright));
    assert!(bench.steps() > 0);
}

#[test]
fn a_node_that_falls_silent_stops_all_others_until_armed() {
    for lost in NodeId::ALL {
        let mut bench = mid_cycle();
        bench.sil.unplug(Station::Node(lost), true);
        let others: Vec<Joint> = NodeId::ALL.into_iter().filter(|id| *id != lost).flat_map(joints_of).collect();
        let all_braked = |bench: &Bench| others.iter().all(|j| bench.sil.commands()[*j as usize] == Drive::Brake);
        let halted_ms = bench.wait(200, |bench| bench.mode() == Mode::Braked).expect("the silence is noticed");
        assert!(halted_ms <= 100 + 2 * TICK_MS, "{lost:?}: {halted_ms} ms");
        bench.run_ms(2 * TICK_MS + 1);
        for _ in 0..1000 {
            bench.step();
            assert!(all_braked(&bench), "{lost:?}");
        }
        let lost_bit = faults::NODE_LOST << lost as u16;
        let telemetry = bench.sil.coordinator().telemetry();
        assert_eq!(telemetry.faults, lost_bit | faults::HALTED, "{lost:?}");

        bench.session.arm().expect("connected");
        bench.run_ms(300);
        assert_eq!(bench.mode(), Mode::Braked, "{lost:?}: armed without it");
        bench.sil.unplug(Station::Node(lost), false);
        bench.run_ms(100);
        stays_braked(&mut bench, 1000);
        assert!(bench.events().contains(&Event::NodeBack(lost)), "{lost:?}");
        arms_again(&mut bench);
        assert_eq!(bench.sil.coordinator().telemetry().faults, 0);
    }
}

#[test]
fn a_stop_whose_answer_was_lost_does_not_come_again_after_it_was_cleared() {
    let mut bench = Bench::armed(&SilConfig::default(), &episode(5, &[]));
    bench.session.e_stop();
    while let Some(bytes) = bench.session.poll(bench.sil.now_us()) {
        bench.sil.host_write(&bytes);
    }
    bench.plugged = false;
    bench.wait(100, |bench| bench.mode() == Mode::Braked).expect("the stop was heard");
    bench.run_ms(20);
    bench.plugged = true;
    bench.session.clear_e_stop().expect("connected");
    bench.run_ms(500);
    assert_eq!(bench.sil.coordinator().telemetry().faults & faults::E_STOP, 0);
    arms_again(&mut bench);
}

#[test]
fn an_emergency_stop_during_a_step_brakes_all_six_within_two_ticks_and_the_latency() {
    let mut bench = mid_cycle();
    assert_ne!(bench.sil.commands(), BRAKED);
    bench.session.e_stop();
    // The bytes wait for a coordinator tick, the halt for a node tick; 1 ms is the bench's own grain.
    let latency_ms = u64::from(SilConfig::default().bus_latency_us.div_ceil(1000));
    let took_ms = bench.wait(100, |bench| bench.sil.commands() == BRAKED).expect("brakes");
    assert!(took_ms <= 2 * TICK_MS + latency_ms + 1, "{took_ms} ms");
    stays_braked(&mut bench, 2000);

    // Neither an arming nor a clearance alone moves it again.
    bench.session.arm().expect("connected");
    bench.run_ms(300);
    assert_eq!(bench.mode(), Mode::Braked);
    bench.session.clear_e_stop().expect("connected");
    stays_braked(&mut bench, 500);
    arms_again(&mut bench);
}
