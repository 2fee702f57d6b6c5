//! Power cut while a set is being written.

use samc21::{Chip, Cycles, Reset, Stop};
use sarah_firmware::default_params;
use sarah_protocol::bus::Mode;
use sarah_protocol::host::{ParamsReport, Which};
use sarah_protocol::params::ParamSet;
use sarah_protocol::session::{HostSession, News};
use sarah_protocol::telemetry::ResetCause;
use sarah_sim::emulated::COORDINATOR;

use crate::rig::{Rig, near_default};
use crate::snapshot::{hang_up, read, write};

/// A robot whose coordinator has begun to write the second of two sets over the first.
fn writing() -> (Rig, [ParamSet; 2]) {
    let sets = [0.02, 0.04].map(near_default);
    let mut rig = Rig::new(&[]);
    rig.wait(1500, "connected", |rig| rig.news.contains(&News::Claimed) && rig.telemetry.faults == 0);
    let first = rig.apply(&sets[0]);
    rig.session.persist().expect("connected");
    rig.wait(200, "persisted", |rig| rig.news.contains(&News::Persisted(first)));
    rig.apply(&sets[1]);
    rig.session.persist().expect("connected");
    rig.wait(200, "it writes", |rig| is_writing(&rig.robot.chips()[COORDINATOR]));
    (rig, sets)
}

fn is_writing(chip: &Chip) -> bool {
    chip.peripherals().nvmctrl.is_busy()
}

fn run(chip: &mut Chip, until: Cycles) {
    assert_eq!(chip.run_until(until), Stop::Time, "{:?}", chip.violations());
}

/// Cuts the power, and asks a host's question when it is back: which set is stored?
fn stored_after_cut(mut chip: Chip, cause: Reset) -> ParamSet {
    chip.reset(cause);
    hang_up(&mut chip);
    let mut session = HostSession::new(9);
    let mut answer = None;
    let mut asked = false;
    for _ in 0..150 {
        let now = chip.now();
        let mut at = now;
        while let Some(bytes) = session.poll(now.0 / 48) {
            at = write(&mut chip, at, &bytes);
        }
        run(&mut chip, now + Cycles::from_micros(10_000).0);
        let bytes = read(&mut chip);
        session.on_bytes(chip.now().0 / 48, &bytes, &mut |item| match item {
            News::Params(ParamsReport { which: Which::Stored, params, .. }) => answer = params,
            News::Claimed => asked = true,
            _ => {}
        });
        if std::mem::take(&mut asked) {
            session.get_params(Which::Stored).expect("room");
        }
        if let Some(params) = answer {
            return ParamSet::new(params).expect("whole sets only");
        }
    }
    panic!("no answer");
}

#[test]
fn power_cut_at_any_moment_of_a_write_leaves_the_old_set_or_the_new_one() {
    let (rig, [old, new]) = writing();
    let mut chip = rig.robot.chips()[COORDINATOR].clone();
    // Long enough for the erasure, three pages and what lies between; a cut every 0.6 ms.
    let end = chip.now() + Cycles::from_micros(22_000).0;
    let mut found = vec![];
    let mut torn = 0;
    while chip.now() < end {
        let cause = if found.len() % 2 == 0 { Reset::PowerOn } else { Reset::BrownOutSupply };
        torn += usize::from(is_writing(&chip));
        found.push(stored_after_cut(chip.clone(), cause));
        let next = chip.now() + Cycles::from_micros(617).0;
        run(&mut chip, next);
    }
    assert!(!is_writing(&chip) && torn > 15, "{torn} of {} cuts tore something", found.len());
    let written = found.iter().position(|set| *set == new).expect("the last cut is late");
    println!("{} cuts, {torn} within an operation; new from the {written}th on", found.len());
    assert!(
        written > 0 && found[..written].iter().all(|set| *set == old) && found[written..].iter().all(|set| *set == new)
    );
}

#[test]
fn after_a_cut_during_a_write_the_robot_comes_back_braked_on_the_old_set() {
    let (mut rig, [old, _]) = writing();
    rig.run_ms(4);
    rig.robot.chips_mut()[COORDINATOR].reset(Reset::BrownOutSupply);
    rig.stays_braked(1500);
    assert_eq!((rig.telemetry.mode, rig.telemetry.reset_cause), (Mode::Braked, ResetCause::BrownOut));
    assert!(rig.news.contains(&News::Rebooted), "{:?}", rig.news);
    rig.arm(1500);
    assert_eq!((rig.ask(Which::Applied), rig.ask(Which::Stored)), (old, old));
    assert_ne!(old, default_params());
}
