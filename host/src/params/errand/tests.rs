//! Errands from opening to done, and every way to fail.

use sarah_firmware::default_params;
use sarah_protocol::host::HelloReply;
use sarah_protocol::params::{ParamError, RawParams, SPECS};
use sarah_protocol::session::{HostSession, SessionError};
use sarah_sim::scenario::Scenario;
use sarah_sim::sil::{Sil, SilConfig};

use super::*;
use crate::link::client::Client;

fn tell(errand: &mut Errand, news: News) -> Result<(), RobotError> {
    errand.on(&Heard { at_us: 1_000_000, what: What::News(news) })
}

fn report(which: Which, params: Option<RawParams>) -> News {
    News::Params(ParamsReport { which, generation: 8, params })
}

/// Opened, all three sets read: applied is the default, nothing staged, Table II stored.
fn read(role: Role) -> Errand {
    let mut errand = Errand::read(role);
    tell(&mut errand, News::Connected(HelloReply::default())).unwrap();
    if role == Role::Writer {
        assert!(errand.asks().is_empty(), "the claim comes first");
        tell(&mut errand, News::Claimed).unwrap();
    }
    assert_eq!(errand.asks(), [Which::Applied, Which::Staged, Which::Stored].map(Ask::Get));
    tell(&mut errand, report(Which::Applied, Some(*default_params().values()))).unwrap();
    tell(&mut errand, report(Which::Staged, None)).unwrap();
    assert!(!errand.idle());
    tell(&mut errand, report(Which::Stored, Some(*ParamSet::table_ii().values()))).unwrap();
    assert!(errand.idle());
    errand
}

fn nearby() -> ParamSet {
    let mut values = *default_params().values();
    values[0] = 0.03;
    ParamSet::new(values).unwrap()
}

#[test]
fn reading_gives_all_three_and_says_which_is_not_there() {
    let errand = read(Role::Observer);
    assert_eq!(errand.sets().get(Which::Applied), Ok(default_params()));
    assert_eq!(errand.sets().get(Which::Stored), Ok(ParamSet::table_ii()));
    assert_eq!(errand.sets().get(Which::Staged), Err(RobotError::NoSet("staged")));
    assert_eq!(errand.at(u64::MAX), Ok(()));
}

#[test]
fn a_change_tells_how_far_it_is() {
    let mut errand = read(Role::Writer);
    assert_eq!(errand.change(0, nearby()), Ok(true));
    assert_eq!(errand.asks(), [Ask::Params(nearby())]);
    tell(&mut errand, News::Staged(9)).unwrap();
    assert!(!errand.idle());
    tell(&mut errand, News::Applied { generation: 9, cycle: 41 }).unwrap();
    assert!(errand.idle());
    let said = errand.said().join("\n");
    assert!(said.contains("sent\n") && said.contains("9 staged") && said.ends_with("9 applied from cycle 41 on"));
    assert_eq!(errand.sets().applied, Some(Known { generation: 9, set: nearby() }));
}

#[test]
fn a_far_goal_takes_two_generations_and_the_same_set_none() {
    let mut errand = read(Role::Writer);
    assert_eq!(errand.change(0, default_params()), Ok(false));
    assert!(errand.idle() && errand.asks().is_empty());
    let mut values = *default_params().values();
    values[0] = 0.9;
    let far = ParamSet::new(values).unwrap();
    assert_eq!(errand.change(0, far), Ok(true));
    tell(&mut errand, News::Staged(9)).unwrap();
    tell(&mut errand, News::Applied { generation: 9, cycle: 1 }).unwrap();
    assert!(!errand.idle());
    tell(&mut errand, News::Staged(10)).unwrap();
    tell(&mut errand, News::Applied { generation: 10, cycle: 2 }).unwrap();
    assert!(errand.idle());
    assert!(errand.said()[0].contains("two generations"));
}

#[test]
fn keeping_says_which_generation_is_kept() {
    let mut errand = read(Role::Writer);
    errand.keep(0);
    assert_eq!(errand.asks(), [Ask::Persist]);
    tell(&mut errand, News::Persisted(8)).unwrap();
    assert!(errand.idle());
    assert!(errand.said()[0].contains("generation 8 stored"));
}

#[test]
fn every_way_to_fail_is_one_line_that_says_what_to_do() {
    let mut all = vec![];
    let opening = Errand::read(Role::Writer);
    all.push((opening.at(OPEN_US + 1), "check that the coordinator has power"));
    let mut claimed = Errand::read(Role::Writer);
    tell(&mut claimed, News::Refused(Command::Claim, Refusal::Claimed { by: 0x12ab })).unwrap();
    all.push((claimed.at(OPEN_US + 1), "session 0x12ab) writes; quit that one"));
    let failed = tell(&mut Errand::read(Role::Writer), News::Failed(SessionError::Version { ours: 1, theirs: 2 }));
    all.push((failed, "flash matching firmware"));
    all.push((tell(&mut read(Role::Writer), News::Rebooted), "restarted"));
    let down = Heard { at_us: 0, what: What::Down { why: "Broken pipe".into() } };
    all.push((read(Role::Writer).on(&down), "Broken pipe; check the cable"));
    let mut changing = read(Role::Writer);
    changing.change(0, nearby()).unwrap();
    all.push((changing.at(APPLY_US + 1), "not staged within 8 s"));
    tell(&mut changing, News::Staged(9)).unwrap();
    all.push((changing.at(APPLY_US + 1), "let the robot stand still or disarm it"));
    let stage = Command::Stage { generation: 9, params: *nearby().values() };
    let why = Refusal::Params(ParamError::OutOfRange { index: 0, value: 9.0 });
    all.push((tell(&mut changing, News::Refused(stage, why)), "P1 = 9 m/s is outside 0.02 to 0.9"));
    let mut keeping = read(Role::Writer);
    keeping.keep(0);
    all.push((keeping.at(KEEP_US + 1), "commit again"));
    all.push((tell(&mut keeping, News::Refused(Command::Persist { generation: 8 }, Refusal::Storage)), "store"));
    let wrong = report(Which::Applied, Some([f32::NAN; 13]));
    all.push((tell(&mut Errand::read(Role::Observer), wrong), "P1 is not a finite number"));
    for (outcome, part) in all {
        let text = outcome.unwrap_err().to_string();
        assert!(text.contains(part), "{text:?} lacks {part:?}");
        assert_eq!(text.lines().count(), 1);
        assert!(!text.contains("  "), "{text}");
    }
}

/// Runs an errand against a robot's whole firmware, in simulated time.
fn run_on(sil: &mut Sil, client: &mut Client, errand: &mut Errand) -> Result<(), RobotError> {
    while !errand.idle() {
        for ask in errand.asks() {
            let session = client.session_mut();
            let asked = match ask {
                Ask::Get(which) => session.get_params(which),
                Ask::Persist => session.persist(),
                Ask::Params(set) => {
                    client.set_params(set);
                    Ok(())
                }
                other => panic!("an errand does not ask {other:?}"),
            };
            asked.unwrap();
        }
        while let Some(bytes) = client.poll(sil.now_us()) {
            sil.host_write(&bytes);
        }
        sil.run_until(sil.now_us() + 10_000).unwrap();
        let (now_us, bytes, mut news) = (sil.now_us(), sil.host_read(), vec![]);
        client.on_bytes(now_us, &bytes, &mut news);
        for news in news {
            errand.on(&Heard { at_us: now_us, what: What::News(news) })?;
        }
        errand.at(now_us)?;
    }
    Ok(())
}

#[test]
fn a_robot_reads_changes_and_keeps_its_set() {
    let episode = Scenario::load("stand").unwrap().episode(7, 0);
    let mut sil = Sil::new(&SilConfig::default(), default_params(), default_params(), &episode).unwrap();
    let mut client = Client::new(HostSession::new(7), None);
    let mut errand = Errand::read(Role::Writer);
    run_on(&mut sil, &mut client, &mut errand).unwrap();
    assert_eq!(errand.sets().get(Which::Applied), Ok(default_params()));
    // Further than one generation may go in every parameter.
    let far = ParamSet::new(SPECS.each_ref().map(|spec| spec.min)).unwrap();
    assert_eq!(errand.change(sil.now_us(), far), Ok(true));
    run_on(&mut sil, &mut client, &mut errand).unwrap();
    assert_eq!(sil.coordinator().applied().1, &far);
    assert_eq!(sil.stored(), None);
    errand.keep(sil.now_us());
    run_on(&mut sil, &mut client, &mut errand).unwrap();
    assert_eq!(sil.stored().map(|(_, set)| *set), Some(far));
    // Someone else reads it, without a claim.
    let mut client = Client::new(HostSession::observer(8), None);
    let mut errand = Errand::read(Role::Observer);
    run_on(&mut sil, &mut client, &mut errand).unwrap();
    assert_eq!(errand.sets().get(Which::Stored), Ok(far));
}
