//! What stops the robot at once: the emergency stop, a dead IMU, a stuck control task.

use samc21::wires::Serial;
use samc21::{Cycles, Width};
use sarah_firmware::board::samc21::wiring;
use sarah_firmware::lpg::knee::Phase;
use sarah_protocol::bus::{HaltReason, Mode, NodeId};
use sarah_protocol::host::{Command, Refusal, ToRobot};
use sarah_protocol::session::News;
use sarah_protocol::telemetry::{Event, ResetCause};
use sarah_sim::emulated::COORDINATOR;

use crate::rig::{BRAKED, Rig, push};
use crate::snapshot::Snapshot;

/// SERCOM of the IMU.
const IMU_SERCOM: usize = 1;
/// From the last bit of an emergency stop on the host link to the last brake coil without current, µs: two turns of the
/// coordinator, of which one is waited for and one reads it, what is on the bus already, the halt, one tick of a node and
/// one period of its pulses.
const STOP_US: u64 = 2_000;

/// Whether a brake coil of any node has current.
fn a_brake_is_released(snapshot: &Snapshot) -> bool {
    NodeId::ALL.into_iter().any(|id| {
        let wires = snapshot.chips()[1 + id as usize].wires();
        let high = |group, pin| wires.share_high(group, pin).is_some_and(|share| share > 0.0);
        wiring::BRAKE.iter().any(|wire| high(wire.pin.group as usize, wire.pin.number))
    })
}

#[test]
fn an_emergency_stop_mid_step_takes_the_current_from_all_brake_coils_within_its_bound() {
    let mut rig = Rig::mid_swing(&[]);
    let begin = Snapshot::of(&mut rig.robot);
    let stop = ToRobot::EStop.encode(7, 999).expect("short");
    let (mut shortest, mut longest) = (u64::MAX, 0);
    // Over two turns of the coordinator, in steps that meet every phase of the nodes' ticks.
    for beginning in 0..40 {
        let mut snapshot = begin.clone();
        let from = snapshot.now() + Cycles::from_micros(53 * beginning).0;
        let heard = snapshot.host_write(from, &stop);
        snapshot.run_until(heard);
        assert!(a_brake_is_released(&snapshot));
        while a_brake_is_released(&snapshot) {
            snapshot.run_until(snapshot.now() + 1);
            assert!(snapshot.now() < heard + Cycles::from_micros(10 * STOP_US).0, "never");
        }
        let took_us = snapshot.now().since(heard) / 48;
        (shortest, longest) = (shortest.min(took_us), longest.max(took_us));
        // And they stay without.
        for _ in 0..100 {
            snapshot.run_until(snapshot.now() + Cycles::from_micros(50).0);
            assert!(!a_brake_is_released(&snapshot));
        }
    }
    println!("emergency stop to brakes: {shortest} to {longest} µs");
    assert!(longest <= STOP_US, "{shortest} to {longest} µs");
}

#[test]
fn an_emergency_stop_is_latched_until_cleared_and_armed() {
    let mut rig = Rig::mid_step(&[push(4.6, 12.0, 180.0)]);
    rig.session.e_stop();
    let took_ms = rig.wait(10, "everything brakes", Rig::is_braked);
    assert!(took_ms <= 3, "{took_ms} ms");
    rig.stays_braked(300);
    rig.session.arm().expect("connected");
    rig.stays_braked(200);
    let refused = |news: &News| matches!(news, News::Refused(Command::Arm { .. }, Refusal::EStop));
    assert!(rig.news.iter().any(refused), "{:?}", rig.news);
    rig.session.clear_e_stop().expect("connected");
    rig.moves_only_when_armed_anew(300);
}

/// The IMU is taken or replaced mid-step by `spoil`, which gives what to put back; then it is put back.
fn the_imu_fails_mid_step(spoil: impl FnOnce(&mut Serial) -> Serial) {
    let mut rig = Rig::mid_step(&[push(4.6, 12.0, 180.0)]);
    let sound = spoil(&mut rig.robot.chips_mut()[COORDINATOR].wires_mut().serial[IMU_SERCOM]);
    // Nothing more is known of the trunk, but a foot in the air is set down.
    rig.wait(1000, "the foot comes down", |rig| rig.phase() == Phase::Extend as u8);
    assert_ne!(rig.node(NodeId::Knee), BRAKED);
    rig.wait(1100, "everything brakes", Rig::is_braked);
    rig.wait(20, "the cycle is over", |rig| rig.phase() == Phase::Idle as u8);
    assert!(rig.said(Event::Halted(HaltReason::ImuLost)), "{:?}", rig.events);
    rig.stays_braked(500);
    assert!(rig.telemetry.mode == Mode::Braked && !rig.said(Event::ImuBack), "{:?}", rig.events);
    rig.robot.chips_mut()[COORDINATOR].wires_mut().serial[IMU_SERCOM] = sound;
    rig.stays_braked(400);
    assert!(rig.said(Event::ImuBack), "{:?}", rig.events);
    rig.moves_only_when_armed_anew(600);
}

#[test]
fn without_an_imu_the_step_is_finished_and_then_everything_brakes() {
    the_imu_fails_mid_step(std::mem::take);
}

#[test]
fn an_imu_that_repeats_itself_is_no_imu() {
    // A copy that nobody tells what the trunk does.
    the_imu_fails_mid_step(|serial| {
        let stuck = serial.clone();
        std::mem::replace(serial, stuck)
    });
}

/// Longest from the last feeding of the watchdog to the reset: its period, by a clock of a few percent, and a look.
const WATCHDOG_MS: u64 = 75;

/// Makes a function never return; what was there before, and where.
fn hang(rig: &mut Rig, chip: usize, function: &str) -> (u32, u32) {
    let chip = &mut rig.robot.chips_mut()[chip];
    let symbol = chip.context().symbols.all().iter().find(|symbol| symbol.name.starts_with(function));
    let address = symbol.unwrap_or_else(|| panic!("no {function}")).address;
    let before = chip.peek(address, Width::Half).expect("in memory");
    // `b .`
    chip.poke(address, &[0xfe, 0xe7]);
    (address, before)
}

fn heal(rig: &mut Rig, chip: usize, (address, before): (u32, u32)) {
    rig.robot.chips_mut()[chip].poke(address, &(before as u16).to_le_bytes());
}

#[test]
fn a_knee_whose_control_tick_hangs_is_reset_by_its_watchdog_and_comes_back_braked() {
    let mut rig = Rig::mid_step(&[push(4.6, 12.0, 180.0)]);
    // On its way down, so that the foot is on the ground when the leg stops.
    rig.wait(1000, "the foot comes down", |rig| rig.phase() == Phase::Extend as u8);
    let chip = 1 + NodeId::Knee as usize;
    let code = hang(&mut rig, chip, "sarah_firmware::board::samc21::node::control_tick");
    let took_ms = rig.wait(200, "the watchdog bites", |rig| rig.node(NodeId::Knee) == BRAKED);
    println!("stuck knee braked after {took_ms} ms");
    assert!(took_ms <= WATCHDOG_MS, "{took_ms} ms");
    heal(&mut rig, chip, code);
    rig.wait(110, "everything brakes", Rig::is_braked);
    rig.stays_braked(700);
    assert!(rig.said(Event::NodeRestarted(NodeId::Knee)), "{:?}", rig.events);
    rig.moves_only_when_armed_anew(500);
}

#[test]
fn a_coordinator_whose_control_task_hangs_is_reset_by_its_watchdog_and_says_so() {
    let mut rig = Rig::mid_step(&[push(4.6, 12.0, 180.0)]);
    let code = hang(&mut rig, COORDINATOR, "sarah_firmware::board::coordinator::control_tick");
    rig.run_ms(WATCHDOG_MS);
    heal(&mut rig, COORDINATOR, code);
    rig.wait(1100, "everything brakes", Rig::is_braked);
    rig.stays_braked(800);
    assert_eq!((rig.telemetry.mode, rig.telemetry.reset_cause), (Mode::Braked, ResetCause::Watchdog));
    assert!(rig.news.contains(&News::Rebooted), "{:?}", rig.news);
    rig.moves_only_when_armed_anew(500);
}
