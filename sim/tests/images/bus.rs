//! Plugs pulled and wires disturbed on the CAN bus.

use samc21::{Unit, Width};
use sarah_firmware::lpg::knee::Phase;
use sarah_protocol::bus::{HaltReason, Mode, NodeId};
use sarah_protocol::telemetry::Event;
use sarah_sim::emulated::COORDINATOR;

use crate::rig::{BRAKED, Rig, push};

/// M_CAN's protocol status register, and its flag for a controller that errors have driven off the bus.
const PSR: u32 = 0x44;
const PSR_BO: u32 = 1 << 7;

fn is_bus_off(rig: &Rig, chip: usize) -> bool {
    // Reading clears the last error code: ask a copy.
    rig.robot.chips()[chip].clone().bus_read(Unit::Can0.base() + PSR, Width::Word) & PSR_BO != 0
}

#[test]
fn a_node_unplugged_from_the_bus_halts_the_others_and_moves_nothing_when_replugged() {
    let id = NodeId::Hip;
    let mut rig = Rig::mid_step(&[push(4.6, 12.0, 180.0)]);
    rig.robot.can_mut().unplug(1 + id as usize);
    let took_ms = rig.wait(200, "everything brakes", Rig::is_braked);
    assert!(took_ms <= 102, "{took_ms} ms");
    rig.stays_braked(300);
    assert!(rig.said(Event::NodeLost(id)) && rig.said(Event::Halted(HaltReason::NodeFault)), "{:?}", rig.events);
    rig.robot.can_mut().plug(1 + id as usize);
    rig.stays_braked(200);
    assert!(rig.said(Event::NodeBack(id)), "{:?}", rig.events);
    rig.moves_only_when_armed_anew(500);
}

#[test]
fn without_its_coordinator_the_knee_finishes_its_cycle_and_a_replugged_one_moves_nothing() {
    let mut rig = Rig::mid_step(&[push(4.6, 12.0, 180.0)]);
    let knee = |rig: &Rig| rig.node(NodeId::Knee);
    let retracting = knee(&rig);
    rig.robot.can_mut().unplug(COORDINATOR);
    rig.run_ms(55);
    assert_eq!(rig.node(NodeId::Hip), BRAKED, "a swing leg brakes where it is, 50 ms after the last message");
    rig.wait(1000, "the knee turns round", |rig| knee(rig) != retracting && !rig.is_braked());
    rig.wait(1100, "everything brakes", Rig::is_braked);
    rig.stays_braked(800);
    rig.robot.can_mut().plug(COORDINATOR);
    rig.stays_braked(200);
    assert!(rig.said(Event::Halted(HaltReason::NodeFault)), "{:?}", rig.events);
    rig.moves_only_when_armed_anew(500);
}

#[test]
fn a_jammed_bus_brakes_everything_and_all_chips_come_back_from_bus_off() {
    let mut rig = Rig::mid_step(&[push(4.6, 12.0, 180.0)]);
    rig.robot.can_mut().jam(true);
    let mut off = [false; 4];
    let mut took_ms = None;
    for millis in 1..=400 {
        rig.step();
        for (chip, off) in off.iter_mut().enumerate() {
            *off |= is_bus_off(&rig, chip);
        }
        if rig.node(NodeId::Hip) == BRAKED && rig.node(NodeId::Abductor) == BRAKED {
            took_ms.get_or_insert(millis);
        }
    }
    assert_eq!(off, [true; 4]);
    assert!(took_ms.is_some_and(|took_ms| took_ms <= 51), "{took_ms:?} ms");
    // The knee may still be on its way to rest.
    rig.wait(800, "everything brakes", Rig::is_braked);
    rig.robot.can_mut().jam(false);
    rig.stays_braked(300);
    assert_eq!([0, 1, 2, 3].map(|chip| is_bus_off(&rig, chip)), [false; 4]);
    assert!(rig.said(Event::Halted(HaltReason::NodeFault)), "{:?}", rig.events);
    assert!(NodeId::ALL.into_iter().all(|id| rig.said(Event::NodeBack(id))), "{:?}", rig.events);
    rig.moves_only_when_armed_anew(300);
}

#[test]
fn a_few_frames_destroyed_mid_step_are_sent_again_and_the_step_goes_on() {
    let mut rig = Rig::mid_step(&[]);
    let steps = rig.telemetry.steps;
    for _ in 0..10 {
        rig.robot.can_mut().corrupt_next(3);
        rig.run_ms(20);
    }
    rig.wait(1500, "the cycle ends", |rig| rig.phase() == Phase::Idle as u8);
    assert_eq!(rig.telemetry.mode, Mode::Armed, "{:?}", rig.events);
    assert!(rig.telemetry.steps > steps);
}
