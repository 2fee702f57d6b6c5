//! Arming, losses, and two hosts at once.

use std::time::{Duration, Instant};

use sarah::link::live::{Ask, Link, Role, What};
use sarah_firmware::default_params;
use sarah_protocol::host::{HelloReply, ToHost};
use sarah_protocol::params::ParamSet;
use sarah_protocol::session::{News, State};
use sarah_sim::line::Faults;

use crate::bench::{Bench, wait};

fn open(bench: &Bench, role: Role) -> Link {
    let link = Link::open(&bench.target().parse().expect("a target"), role).expect("opens");
    wait("the session", || link.health().state == State::Open);
    link
}

/// Asks until the robot is armed: right after power-up the IMU still finds up.
fn arm(bench: &Bench, link: &Link) {
    wait("arming", || {
        link.ask(Ask::Arm);
        std::thread::sleep(Duration::from_millis(100));
        bench.armed()
    });
}

fn other() -> ParamSet {
    default_params().towards(&ParamSet::table_ii())
}

/// Everything heard until now.
fn drain(link: &Link) -> Vec<What> {
    std::iter::from_fn(|| link.next(Duration::ZERO)).map(|heard| heard.what).collect()
}

#[test]
fn telemetry_comes_a_hundred_times_a_second_without_loss() {
    let bench = Bench::new();
    let link = open(&bench, Role::Observer);
    drain(&link);
    let began = Instant::now();
    std::thread::sleep(Duration::from_secs(2));
    let seconds = began.elapsed().as_secs_f64();
    let frames = drain(&link).iter().filter(|what| matches!(what, What::News(News::Telemetry(_)))).count() as f64;
    assert!((90.0..110.0).contains(&(frames / seconds)), "{frames} in {seconds} s");
    let stats = link.health().stats;
    assert_eq!((stats.lost, stats.frame_errors, stats.undecodable), (0, 0, 0));
}

#[test]
fn a_set_is_applied_and_both_sides_know_it() {
    let bench = Bench::new();
    let link = open(&bench, Role::Writer);
    link.ask(Ask::Params(other()));
    bench.wait("the set", |bench| bench.applied().1 == other());
    wait("the host to know", || link.health().params == Some(other()) && link.health().settled);
    assert_eq!(link.health().applied, bench.applied().0);
}

#[test]
fn a_reconnection_arms_nothing_and_braked_stays_braked() {
    let bench = Bench::new();
    let link = open(&bench, Role::Writer);
    bench.unplug();
    wait("the loss", || !link.health().up);
    link.ask(Ask::Arm);
    std::thread::sleep(Duration::from_millis(300));
    bench.plug();
    wait("the session", || link.health().up && link.health().state == State::Open);
    std::thread::sleep(Duration::from_secs(2));
    assert!(!bench.armed(), "a word spoken into a pulled cable moved the robot");
    assert_eq!(link.health().reconnects, 1);
    arm(&bench, &link);
}

#[test]
fn a_robot_whose_cable_is_pulled_balances_on_and_is_found_again() {
    let bench = Bench::new();
    let link = open(&bench, Role::Writer);
    arm(&bench, &link);
    bench.unplug();
    std::thread::sleep(Duration::from_millis(2500));
    assert!(bench.armed());
    bench.plug();
    wait("the session", || link.health().up && link.health().state == State::Open);
    link.ask(Ask::Params(other()));
    bench.wait("the set", |bench| bench.applied().1 == other());
}

#[test]
fn a_robot_that_restarted_is_braked_and_runs_its_stored_set() {
    let bench = Bench::new();
    let link = open(&bench, Role::Writer);
    link.ask(Ask::Params(other()));
    wait("the set", || link.health().params == Some(other()));
    link.ask(Ask::Persist);
    bench.wait("the memory", |bench| bench.stored() == Some(other()));
    arm(&bench, &link);
    link.ask(Ask::Params(default_params()));
    bench.wait("another set", |bench| bench.applied().1 == default_params());
    bench.power_cycle("duration_s = 30.0\ndrop_m = 0.02\nsettle_s = 1.0\n");
    bench.wait("the stored set", |bench| bench.applied().1 == other());
    wait("the host to notice", || drain(&link).contains(&What::News(News::Rebooted)));
    std::thread::sleep(Duration::from_secs(2));
    assert!(!bench.armed(), "nobody said a word after the restart");
}

#[test]
fn of_two_hosts_on_one_port_the_second_is_told() {
    let bench = Bench::new();
    let _first = open(&bench, Role::Writer);
    let second = Link::open(&bench.target().parse().expect("a target"), Role::Observer);
    let error = second.err().map(|error| error.to_string()).unwrap_or_default();
    assert!(error.contains("in use by another program"), "{error}");
}

#[test]
fn a_bad_line_loses_no_change_and_applies_none_twice() {
    let bench = Bench::new();
    let link = open(&bench, Role::Writer);
    wait("the set in force", || link.health().params.is_some());
    bench.line(Faults { lose: 0.002, double: 0.001, flip: 0.002 });
    let mut generations = vec![];
    for round in 0..10 {
        let set = if round % 2 == 0 { other() } else { default_params() };
        link.ask(Ask::Params(set));
        bench.wait("the set", |bench| bench.applied().1 == set);
        wait("the host to know", || link.health().params == Some(set));
        generations.push(bench.applied().0);
    }
    assert!(generations.windows(2).all(|pair| pair[1] == pair[0] + 1), "{generations:?}");
    let stats = link.health().stats;
    assert!(stats.frame_errors > 0 && stats.retries > 0, "the line was bad: {stats:?}");
}

#[test]
fn an_emergency_stop_needs_clearing_and_arming() {
    let bench = Bench::new();
    let link = open(&bench, Role::Writer);
    arm(&bench, &link);
    link.ask(Ask::EStop);
    bench.wait("brakes", |bench| !bench.armed());
    link.ask(Ask::Arm);
    std::thread::sleep(Duration::from_millis(300));
    assert!(!bench.armed(), "stopped means stopped");
    link.ask(Ask::ClearEStop);
    std::thread::sleep(Duration::from_millis(300));
    assert!(!bench.armed());
    arm(&bench, &link);
}

#[test]
fn firmware_of_another_version_is_named_and_nothing_is_trained() {
    let mut terminal = sarah::emulate::terminal::Terminal::new().expect("a pseudo-terminal");
    let port = terminal.path();
    let answers = std::thread::spawn(move || {
        let reply = ToHost::Hello(HelloReply { version: 9, ..HelloReply::default() });
        let hello = reply.encode(0, 1).expect("fits");
        let began = Instant::now();
        let mut said = vec![];
        while began.elapsed() < Duration::from_secs(4) {
            let heard = terminal.exchange(&said).expect("exchanges");
            said = if heard.is_empty() { vec![] } else { hello.to_vec() };
            std::thread::sleep(Duration::from_millis(5));
        }
    });
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("run").display().to_string();
    let link = format!("serial:{port}");
    let output = crate::training::sarah(&["train", "--link", &link, "--out", &out]).output().expect("ends");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && said.contains("flash matching firmware"), "{said}");
    answers.join().expect("answers");
}
