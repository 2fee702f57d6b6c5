//! The dashboard as a whole, drawn on a terminal of memory.

use proptest::prelude::*;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use sarah_firmware::default_params;
use sarah_protocol::bus::{HaltReason, Mode, limits};
use sarah_protocol::fixed::Q16;
use sarah_protocol::host::{Command, HelloReply, NotReady, ParamsReport, Refusal, Which};
use sarah_protocol::params::ParamSet;
use sarah_protocol::session::{LinkStats, News, SessionError, State};
use sarah_protocol::telemetry::{Event, ResetCause, Telemetry, faults};

use super::*;
use crate::link::live::{Ask, Heard, LinkHealth, What};

const NOW: u64 = 5_000_000;

fn health(up: bool, state: State) -> LinkHealth {
    LinkHealth {
        port: "/dev/ttyACM0".into(),
        up,
        reconnects: 0,
        state,
        robot: None,
        stats: LinkStats::default(),
        applied: 8,
        staged: None,
        persisted: None,
        params: None,
        settled: true,
    }
}

fn quiet() -> Telemetry {
    Telemetry {
        loads: [900, 650, 880, 660],
        factor: Q16::lit(0.0385),
        mode: Mode::Armed,
        generation: 8,
        generation_age_ms: 12_000,
        ..Telemetry::default()
    }
}

fn tell(dashboard: &mut Dashboard, at_us: u64, news: News) {
    dashboard.on(&Heard { at_us, what: What::News(news) });
}

/// A connected monitor that has heard a second of telemetry up to [`NOW`].
fn watching(role: Role, telemetry: Telemetry) -> Dashboard {
    let mut dashboard = Dashboard::new(role);
    dashboard.on(&Heard { at_us: 0, what: What::Up { port: "/dev/ttyACM0".into() } });
    tell(&mut dashboard, 0, News::Connected(HelloReply { nodes: 7, ..HelloReply::default() }));
    dashboard.set_health(health(true, State::Open));
    for (which, generation) in [(Which::Applied, 8), (Which::Stored, 0)] {
        let params = Some(*default_params().values());
        tell(&mut dashboard, 0, News::Params(ParamsReport { which, generation, params }));
    }
    tell(&mut dashboard, 0, News::Params(ParamsReport { which: Which::Staged, generation: 0, params: None }));
    for at_us in (NOW - 990_000..=NOW).step_by(10_000) {
        tell(&mut dashboard, at_us, News::Telemetry(Telemetry { time_us: at_us as u32, ..telemetry }));
    }
    dashboard
}

fn screen(dashboard: &Dashboard, now_us: u64, width: u16, height: u16) -> String {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| dashboard.view(frame, now_us)).unwrap();
    let cells = terminal.backend().buffer().content().chunks(usize::from(width));
    cells.map(|row| row.iter().map(|cell| cell.symbol()).collect::<String>() + "\n").collect()
}

#[track_caller]
fn shows(screen: &str, parts: &[&str]) {
    // Lines break anywhere between words.
    let flat = screen.split_whitespace().collect::<Vec<_>>().join(" ");
    for part in parts {
        assert!(flat.contains(part), "{part:?} is not in\n{screen}");
    }
}

#[test]
fn armed_and_quiet_at_80_by_24_shows_everything_that_matters() {
    let screen = screen(&watching(Role::Writer, quiet()), NOW, 80, 24);
    shows(&screen, &["ARMED, stands quietly", "no faults, nothing limits motion", "/dev/ttyACM0"]);
    shows(&screen, &["knee idle", "hip idle", "abductor idle", "0.0 steps/s", "Factor 0.038", "0.07"]);
    shows(&screen, &["155 N", "154 N", "lean 0.000 rad", "energy, estimated", "11 W computers", "log"]);
    shows(&screen, &["applied", "generation 8 for 12 s", "staged nothing", "stored the same as applied"]);
    shows(&screen, &["frames/s", "lost 0", "CRC errors 0", "retries 0", "trip"]);
    shows(&screen, &["a arm", "space stop", "q quit"]);
    for spec in &sarah_protocol::params::SPECS {
        shows(&screen, &[&format!(" {} ", spec.symbol), spec.unit]);
    }
}

#[test]
fn every_panel_is_there_at_120_by_40_and_in_one_column() {
    for (width, height) in [(120, 40), (60, 70)] {
        let screen = screen(&watching(Role::Writer, quiet()), NOW, width, height);
        shows(&screen, &["gait", "feet", "posture", "parameters", "link", "energy", "log", "the robot said hello"]);
        shows(&screen, &["loaded", "dropped there 0", "reconnects 0", "simulated", "hears knee hip abductor"]);
    }
    shows(&screen(&watching(Role::Writer, quiet()), NOW, 120, 40), &["kick: speed of the first extension"]);
}

#[test]
fn a_lost_imu_is_said_with_its_remedy() {
    let limits = [limits::BRAKED | limits::HALTED; 3];
    let faults = faults::HALTED | faults::IMU_LOST;
    let mut dashboard = watching(Role::Writer, Telemetry { mode: Mode::Braked, faults, limits, ..quiet() });
    tell(&mut dashboard, NOW, News::Event { time_us: 0, event: Event::Halted(HaltReason::ImuLost) });
    let screen = screen(&dashboard, NOW, 80, 24);
    shows(
        &screen,
        &["HALTED: the IMU stopped delivering", "no IMU sample: check the ribbon to EXT1, then press a to arm"],
    );
    assert!(!screen.contains("brakes are on"), "the halt says it already\n{screen}");
    let telemetry = Telemetry { mode: Mode::Braked, faults: faults::HALTED, ..quiet() };
    let mut dashboard = watching(Role::Writer, telemetry);
    tell(&mut dashboard, NOW, News::Event { time_us: 0, event: Event::Halted(HaltReason::Disarmed) });
    shows(&self::screen(&dashboard, NOW, 80, 24), &["HALTED: disarmed", "press a to arm"]);
}

#[test]
fn an_emergency_stop_is_said_with_the_way_out() {
    let telemetry = Telemetry { mode: Mode::Braked, faults: faults::E_STOP | faults::HALTED, ..quiet() };
    let screen = screen(&watching(Role::Writer, telemetry), NOW, 80, 24);
    shows(&screen, &["EMERGENCY STOP", "press c to clear it and a to arm"]);
}

#[test]
fn a_link_that_is_down_says_why_and_nothing_old_looks_true() {
    let mut dashboard = watching(Role::Writer, quiet());
    dashboard.on(&Heard { at_us: NOW, what: What::Down { why: "Broken pipe".into() } });
    dashboard.set_health(health(false, State::Greeting));
    let text = screen(&dashboard, NOW + 1_000_000, 80, 24);
    shows(
        &text,
        &["LINK DOWN", "the link is down (Broken pipe)", "check the USB cable", "balancing", "down, tried again"],
    );
    assert!(!text.contains("ARMED"), "{text}");
    assert_eq!(dashboard.act(Act::Arm, NOW), None);
    shows(&screen(&dashboard, NOW, 80, 24), &["the link is down: nothing was sent"]);
    assert_eq!(dashboard.act(Act::EStop, NOW), Some(Ask::EStop));
    shows(&screen(&dashboard, NOW, 120, 24), &["cut the power at the robot"]);
}

#[test]
fn silence_and_a_stale_set_are_told_apart() {
    let silent = screen(&watching(Role::Writer, quiet()), NOW + 3_200_000, 80, 24);
    shows(&silent, &["NO TELEMETRY", "no telemetry for 3.2 s", "0 frames/s"]);
    let stale = screen(&watching(Role::Observer, Telemetry { stale: true, ..quiet() }), NOW, 80, 24);
    shows(&stale, &["ARMED", "STALE", "a host that is silent; the stored set returns soon", "watching"]);
}

#[test]
fn wrong_firmware_and_another_writer_are_named() {
    let mut dashboard = Dashboard::new(Role::Writer);
    tell(&mut dashboard, 0, News::Failed(SessionError::Version { ours: 1, theirs: 2 }));
    shows(&screen(&dashboard, 0, 80, 24), &["WRONG FIRMWARE", "protocol version 2", "flash matching firmware"]);
    let mut dashboard = watching(Role::Writer, quiet());
    tell(&mut dashboard, NOW, News::Refused(Command::Claim, Refusal::Claimed { by: 0x12ab }));
    shows(&screen(&dashboard, NOW, 80, 24), &["another host writes (session 0x12ab)", "quit that one"]);
    assert_eq!(dashboard.act(Act::Arm, NOW), None);
    assert_eq!(dashboard.act(Act::EStop, NOW), Some(Ask::EStop));
}

#[test]
fn steps_and_the_swing_leg_are_shown_while_it_steps() {
    let mut dashboard = watching(Role::Writer, quiet());
    for index in 1..=20u32 {
        let at_us = NOW + u64::from(index) * 10_000;
        let mut telemetry =
            Telemetry { time_us: at_us as u32, phases: [2, 2, 1], factor: Q16::lit(0.3), steps: 2, ..quiet() };
        telemetry.loads = [0, 0, 1500, 1500];
        telemetry.joints[2] = Q16::lit(-0.002 * f64::from(index));
        tell(&mut dashboard, at_us, News::Telemetry(telemetry));
    }
    let screen = screen(&dashboard, NOW + 200_000, 80, 24);
    shows(&screen, &["ARMED, steps", "knee left retract", "right holds", "hip left moving", "abductor left ready"]);
    shows(&screen, &["1.0 steps/s", "2 in all", "in air", "300 N", "> 0.07"]);
}

#[test]
fn sets_that_differ_are_marked() {
    let mut dashboard = watching(Role::Writer, quiet());
    let other = Some(*ParamSet::table_ii().values());
    let p1 = default_params().values()[0];
    tell(&mut dashboard, NOW, News::Params(ParamsReport { which: Which::Stored, generation: 0, params: other }));
    tell(&mut dashboard, NOW, News::Params(ParamsReport { which: Which::Staged, generation: 9, params: other }));
    shows(&screen(&dashboard, NOW, 80, 24), &["staged generation 9", "≠", "differs in 13 of 13"]);
    shows(
        &screen(&dashboard, NOW, 130, 40),
        &["applied staged stored", &format!("{p1:.4} 0.5430 0.5430"), "stored differs in 13 of 13"],
    );
}

#[test]
fn arming_asks_first_and_only_yes_arms() {
    let braked = Telemetry { mode: Mode::Braked, ..quiet() };
    let mut dashboard = watching(Role::Writer, braked);
    shows(&screen(&dashboard, NOW, 80, 24), &["BRAKED", "nothing is wrong: press a to arm"]);
    assert_eq!(dashboard.act(Act::Yes, NOW), None);
    assert_eq!(dashboard.act(Act::Arm, NOW), None);
    shows(&screen(&dashboard, NOW, 80, 24), &["arm?", "y/n"]);
    for other in [Act::No, Act::Help, Act::Disarm] {
        dashboard.act(Act::Arm, NOW);
        dashboard.act(other, NOW);
        assert_eq!(dashboard.act(Act::Yes, NOW), None, "{other:?} withdraws the question");
    }
    dashboard.act(Act::Arm, NOW);
    assert_eq!(dashboard.act(Act::Yes, NOW + 11_000_000), None, "the question is forgotten after a while");
    dashboard.act(Act::Arm, NOW);
    assert_eq!(dashboard.act(Act::Yes, NOW), Some(Ask::Arm));
    let refusal = Refusal::NotReady(NotReady::Imu);
    tell(&mut dashboard, NOW, News::Refused(Command::Arm { boot_nonce: 1 }, refusal));
    dashboard.act(Act::Help, NOW);
    shows(&screen(&dashboard, NOW, 80, 24), &["arm was refused: not ready: the IMU does not deliver yet"]);
}

#[test]
fn the_stop_is_sent_at_once_even_from_the_question_or_the_help() {
    for role in [Role::Writer, Role::Observer] {
        let mut dashboard = watching(role, quiet());
        assert_eq!(dashboard.act(Act::EStop, NOW), Some(Ask::EStop));
        dashboard.act(Act::Help, NOW);
        assert_eq!(dashboard.act(Act::EStop, NOW), Some(Ask::EStop));
        dashboard.act(Act::Arm, NOW);
        assert_eq!(dashboard.act(Act::EStop, NOW), Some(Ask::EStop));
        assert_eq!(dashboard.act(Act::Yes, NOW), None, "nothing arms after a stop");
    }
}

#[test]
fn a_halt_or_a_lost_link_withdraws_the_question() {
    let braked = Telemetry { mode: Mode::Braked, ..quiet() };
    let mut dashboard = watching(Role::Writer, braked);
    dashboard.act(Act::Arm, NOW);
    tell(&mut dashboard, NOW, News::Event { time_us: 0, event: Event::Halted(HaltReason::NodeFault) });
    assert_eq!(dashboard.act(Act::Yes, NOW), None);
    dashboard.act(Act::Arm, NOW);
    tell(&mut dashboard, NOW, News::Rebooted);
    assert_eq!(dashboard.act(Act::Yes, NOW), None);
}

#[test]
fn an_observer_may_only_stop_and_quit() {
    let mut dashboard = watching(Role::Observer, quiet());
    for act in [Act::Arm, Act::Disarm, Act::ClearEStop] {
        assert_eq!(dashboard.act(act, NOW), None);
        assert_eq!(dashboard.act(Act::Yes, NOW), None);
    }
    dashboard.act(Act::Arm, NOW);
    shows(&screen(&dashboard, NOW, 80, 24), &["this monitor only watches"]);
    assert!(!dashboard.quits());
    assert_eq!(dashboard.act(Act::Quit, NOW), None);
    assert!(dashboard.quits());
}

#[test]
fn disarm_and_clear_go_out_and_help_says_what_keys_do() {
    let mut dashboard = watching(Role::Writer, quiet());
    assert_eq!(dashboard.act(Act::Disarm, NOW), Some(Ask::Disarm));
    assert_eq!(dashboard.act(Act::ClearEStop, NOW), Some(Ask::ClearEStop));
    dashboard.act(Act::Help, NOW);
    let help = screen(&dashboard, NOW, 80, 24);
    shows(&help, &["emergency stop: at once", "the robot goes on as it is", "`sarah params commit` keeps it."]);
    dashboard.act(Act::No, NOW);
    shows(&screen(&dashboard, NOW, 80, 24), &["gait"]);
}

#[test]
fn the_sets_are_asked_for_only_while_the_link_is_open() {
    let mut dashboard = Dashboard::new(Role::Writer);
    assert_eq!(dashboard.due(NOW), None);
    dashboard.set_health(health(true, State::Claiming));
    assert_eq!(dashboard.due(NOW), None);
    dashboard.set_health(health(true, State::Open));
    assert_eq!(dashboard.due(NOW), Some(Ask::Get(Which::Applied)));
    assert_eq!(dashboard.due(NOW + 200_000), Some(Ask::Get(Which::Staged)));
    tell(&mut dashboard, NOW, News::Staged(9));
    assert_eq!(dashboard.due(NOW + 400_000), Some(Ask::Get(Which::Applied)));
}

#[test]
fn one_line_says_what_the_screen_says() {
    let line = watching(Role::Observer, quiet()).line(NOW);
    assert_eq!(line.lines().count(), 1);
    shows(&line, &["5.0 s ARMED, stands quietly", "Factor 0.038", "generation 8 for 12 s", "100 frames/s", "lost 0"]);
    let lost = Telemetry { mode: Mode::Braked, faults: faults::IMU_LOST, ..quiet() };
    shows(&watching(Role::Observer, lost).line(NOW), &["BRAKED, not ready", "no IMU sample (check the ribbon"]);
    shows(&Dashboard::new(Role::Observer).line(0), &["CONNECTING"]);
}

fn any_telemetry() -> impl Strategy<Value = Telemetry> {
    let numbers = (any::<[i32; 6]>(), any::<[i32; 2]>(), any::<i32>(), any::<[u16; 4]>(), any::<[u8; 3]>());
    let counters = (any::<u32>(), any::<u32>(), any::<u32>(), any::<u32>(), any::<u32>(), any::<u32>());
    let state = (any::<bool>(), any::<bool>(), any::<u16>(), any::<[u16; 3]>());
    (numbers, counters, state).prop_map(|(numbers, counters, state)| {
        let (joints, lean, factor, loads, phases) = numbers;
        let (time_us, steps, cycle, generation, generation_age_ms, dropped) = counters;
        let (stale, armed, faults, limits) = state;
        Telemetry {
            time_us,
            accel: [i16::MIN; 3],
            gyro: [i16::MAX; 3],
            gyro_bias: [i16::MIN; 3],
            loads,
            joints: joints.map(Q16),
            lean: lean.map(Q16),
            phases: if stale { phases } else { phases.map(|phase| phase % 4) },
            factor: Q16(factor),
            steps,
            cycle,
            generation,
            generation_age_ms,
            stale,
            mode: if armed { Mode::Armed } else { Mode::Braked },
            faults,
            limits,
            reset_cause: if armed { ResetCause::Watchdog } else { ResetCause::BrownOut },
            dropped,
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    #[test]
    fn any_telemetry_at_any_size_is_drawn(
        course in proptest::collection::vec((any_telemetry(), any::<u64>()), 0..6),
        values in any::<[f32; sarah_protocol::params::COUNT]>(),
        (width, height) in (1..200u16, 1..60u16),
        now_us in any::<u64>(),
        help in any::<bool>(),
    ) {
        let mut dashboard = Dashboard::new(Role::Writer);
        dashboard.set_health(health(true, State::Open));
        for which in [Which::Applied, Which::Staged, Which::Stored] {
            tell(&mut dashboard, 0, News::Params(ParamsReport { which, generation: 1, params: Some(values) }));
        }
        for (telemetry, at_us) in course {
            tell(&mut dashboard, at_us, News::Telemetry(telemetry));
            tell(&mut dashboard, at_us, News::Event { time_us: 0, event: Event::Applied { generation: 1, cycle: 2 } });
        }
        dashboard.help = help;
        screen(&dashboard, now_us, width, height);
        prop_assert_eq!(dashboard.line(now_us).lines().count(), 1);
    }
}
