//! A bad line to the host, and none.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use sarah_firmware::default_params;
use sarah_protocol::bus::{GaitEvent, Message, Mode};
use sarah_protocol::host::Which;
use sarah_protocol::params::ParamSet;
use sarah_protocol::session::News;

use sarah_sim::line::{Faults, Line};

use crate::rig::{Passed, Rig, near_default, push};

/// The generations that the knee named, each once, in order; that none took force inside a cycle.
fn generations(passed: &[Passed]) -> Vec<u32> {
    let mut named = vec![0];
    let mut in_cycle = false;
    for Passed { at, message } in passed {
        let Message::Gait(gait) = message else { continue };
        if named.last() != Some(&gait.generation) {
            assert!(!in_cycle && gait.event == GaitEvent::Boundary, "{gait:?} at {at:?}");
            named.push(gait.generation);
        }
        in_cycle = match gait.event {
            GaitEvent::CycleStart | GaitEvent::Recovery => true,
            GaitEvent::CycleEnd => false,
            _ => in_cycle,
        };
    }
    named
}

#[test]
fn over_a_bad_line_every_set_arrives_whole_and_takes_force_once() {
    let mut rig = Rig::armed(&[]);
    let mut line = Line::new(Faults::one_in(100.0), 11);
    rig.line = Some(Box::new(move |bytes| line.pass(bytes)));
    let mut dice = Pcg64Mcg::seed_from_u64(12);
    rig.breaks = Some(Box::new(move || dice.random_ratio(1, 8)));
    let sets = [0.01, 0.02, 0.03, 0.04].map(near_default);
    let applied = sets.map(|set| rig.apply(&set));
    rig.session.persist().expect("connected");
    rig.wait(3000, "persisted", |rig| rig.news.contains(&News::Persisted(applied[3])));
    assert!(rig.session.stats().retries > 0, "the line was not that bad: {:?}", rig.session.stats());

    assert!(applied.is_sorted());
    assert_eq!(generations(&rig.passed), [&[0], &applied[..]].concat());
    for Passed { message, .. } in &rig.passed {
        let Message::Stage(stage) = message else { continue };
        let index = applied.iter().position(|generation| *generation == stage.generation);
        // One that was given up for a newer number was whole too.
        let whole = |set: &ParamSet| *set.values() == stage.params;
        assert!(index.map_or(sets.iter().any(whole), |index| whole(&sets[index])), "{stage:?}");
    }
    (rig.line, rig.breaks) = (None, None);
    assert_eq!((rig.ask(Which::Applied), rig.ask(Which::Stored)), (sets[3], sets[3]));
    assert_eq!(rig.telemetry.mode, Mode::Armed, "{:?}", rig.events);
}

#[test]
fn a_host_gone_for_20_s_leaves_the_robot_balancing_then_on_its_stored_set() {
    // Pushed while the set is stale, and as the stored one is due.
    let mut rig = Rig::armed(&[push(8.0, 18.0, 0.0), push(11.9, 18.0, 90.0)]);
    let set = near_default(0.01);
    let generation = rig.apply(&set);
    rig.run_until_ms(2000);

    rig.plugged = false;
    let (mut stale_at_ms, mut back_at_ms) = (None, None);
    for millis in 1..=20_000 {
        rig.step();
        assert_eq!(rig.telemetry.mode, Mode::Armed, "after {millis} ms: {:?}", rig.events);
        if rig.telemetry.stale {
            stale_at_ms.get_or_insert(millis);
            assert_eq!(rig.telemetry.generation, generation, "after {millis} ms");
        }
        if rig.telemetry.generation != generation {
            back_at_ms.get_or_insert(millis);
        }
    }
    let (stale_at_ms, back_at_ms) = (stale_at_ms.expect("flagged"), back_at_ms.expect("fell back"));
    println!("stale after {stale_at_ms} ms, stored set after {back_at_ms} ms");
    // The last word of the host is at most a heartbeat old when the line goes.
    assert!((1_490..=2_020).contains(&stale_at_ms), "{stale_at_ms} ms");
    assert!((9_490..=13_000).contains(&back_at_ms), "{back_at_ms} ms");
    assert!(!rig.telemetry.stale && rig.telemetry.faults == 0);
    assert!(rig.telemetry.steps >= 2, "{:?}", rig.telemetry);
    assert_eq!(generations(&rig.passed), [0, generation, rig.telemetry.generation]);

    rig.plugged = true;
    rig.run_ms(2500);
    assert_eq!((rig.ask(Which::Applied), rig.ask(Which::Stored)), (default_params(), default_params()));
    assert_eq!(rig.telemetry.mode, Mode::Armed);
}
