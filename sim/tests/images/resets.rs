//! A chip starts over in the middle of a step.

use samc21::Reset;
use sarah_protocol::bus::{HaltReason, Mode, NodeId};
use sarah_protocol::session::News;
use sarah_protocol::telemetry::{Event, ResetCause};
use sarah_sim::emulated::COORDINATOR;

use crate::rig::{BRAKED, Rig, push};

fn a_node_resets_mid_step(id: NodeId) {
    let mut rig = Rig::mid_swing(&[push(4.6, 12.0, 180.0)]);
    rig.robot.chips_mut()[1 + id as usize].reset(Reset::External);
    rig.step();
    assert_eq!(rig.node(id), BRAKED, "a chip in reset lets go of its pins, and the brakes fall in");
    // Its first word, or a silence of 100 ms: whichever comes first. The halt is on the bus one turn later.
    let took_ms = rig.wait(200, "everything brakes", Rig::is_braked);
    println!("{id:?} reset: everything braked after {took_ms} ms, {:?}", rig.events);
    assert!(took_ms <= 102, "{took_ms} ms");
    rig.stays_braked(700);
    assert!(rig.said(Event::Halted(HaltReason::NodeFault)) && rig.said(Event::NodeRestarted(id)), "{:?}", rig.events);
    rig.moves_only_when_armed_anew(500);
}

#[test]
fn a_knee_that_resets_mid_step_halts_the_others_and_moves_again_when_armed_anew() {
    a_node_resets_mid_step(NodeId::Knee);
}

#[test]
fn a_hip_that_resets_mid_step_halts_the_others_and_moves_again_when_armed_anew() {
    a_node_resets_mid_step(NodeId::Hip);
}

#[test]
fn a_coordinator_that_resets_mid_step_comes_back_unarmed() {
    let mut rig = Rig::mid_step(&[push(4.6, 12.0, 180.0)]);
    rig.robot.chips_mut()[COORDINATOR].reset(Reset::External);
    // Without motion messages the knee finishes its cycle; the coordinator is back, and braked, after half a second.
    rig.wait(700, "everything brakes", Rig::is_braked);
    rig.stays_braked(1000);
    assert_eq!((rig.telemetry.mode, rig.telemetry.reset_cause), (Mode::Braked, ResetCause::External));
    assert!(rig.news.contains(&News::Rebooted), "{:?}", rig.news);
    rig.moves_only_when_armed_anew(500);
}
