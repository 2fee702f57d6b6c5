//! What a node does with parameters, with lost neighbours and with a halt.

use proptest::prelude::*;
use sarah_firmware::lpg::Drive;
use sarah_firmware::lpg::rules::KNEE;
use sarah_firmware::node::{self, Node, NodeConfig, NodeKind, Outputs, Sensors};
use sarah_protocol::bus::{Gait, GaitEvent, HaltReason, Message, Mode, Motion, NodeId, Side, Stage, Staged, limits};
use sarah_protocol::fixed::Q16;
use sarah_protocol::params::{ParamError, ParamSet, SPECS};

const DT: u32 = 1_000;

fn node(id: NodeId) -> NodeKind {
    let config = NodeConfig {
        default: ParamSet::table_ii(),
        boot_nonce: 7,
        end_stop: Q16::lit(0.118),
        plausible: Q16::lit(0.16),
    };
    node::by_id(id, config)
}

fn standing() -> Sensors {
    Sensors { position: [Q16::ZERO; 2], load: [Q16::lit(75.0); 4] }
}

fn armed(rotation: f64) -> Message {
    Message::Motion(Motion {
        mode: Mode::Armed,
        acceleration: Q16::lit(9.81),
        rotation: Q16::lit(rotation),
        slow_rate: [Q16::lit(rotation); 2],
        ..Motion::default()
    })
}

/// A knee that was armed and has stood still since.
fn standing_knee() -> NodeKind {
    let mut knee = node(NodeId::Knee);
    for _ in 0..KNEE.stand_us / DT {
        knee.on_message(&armed(0.0));
        knee.tick(DT, &standing());
    }
    knee
}

fn stage(generation: u32) -> Message {
    let mut params = *ParamSet::table_ii().values();
    params[0] = 0.3;
    params[7] = 4.0;
    Message::Stage(Stage { generation, params })
}

fn gait(event: GaitEvent, generation: u32) -> Message {
    Message::Gait(Gait { event, swing: Side::Left, cycle: 1, generation })
}

fn generation(node: &NodeKind) -> u32 {
    match node {
        NodeKind::Knee(knee) => knee.generation(),
        NodeKind::Swing(swing) => swing.generation(),
    }
}

fn flags(out: &Outputs) -> Vec<(GaitEvent, u32)> {
    let gaits = out.messages.iter().filter_map(|m| match m {
        Message::Gait(gait) => Some((gait.event, gait.generation)),
        _ => None,
    });
    gaits.filter(|g| g.0 != GaitEvent::Beat).collect()
}

fn limits_of(out: &Outputs) -> Option<u16> {
    out.messages.iter().find_map(|m| match m {
        Message::Status(_, status) => Some(status.limits),
        _ => None,
    })
}

#[test]
fn a_bad_set_is_refused_by_field_and_nothing_is_staged() {
    let mut knee = node(NodeId::Knee);
    let mut params = *ParamSet::table_ii().values();
    params[12] = f32::NAN;
    let answer = knee.on_message(&Message::Stage(Stage { generation: 1, params }));
    let refused = Staged { generation: 1, result: Err(ParamError::NotFinite { index: 12 }) };
    assert_eq!(answer, Some(Message::Staged(NodeId::Knee, refused)));
    knee.on_message(&Message::Activate(1));
    knee.tick(DT, &standing());
    assert_eq!(generation(&knee), 0);
}

#[test]
fn a_staged_set_waits_for_activation_and_a_repeated_stage_is_answered_alike() {
    let mut knee = node(NodeId::Knee);
    let first = knee.on_message(&stage(1));
    assert_eq!(knee.on_message(&stage(1)), first);
    for _ in 0..50 {
        knee.tick(DT, &standing());
    }
    assert_eq!(generation(&knee), 0);
    knee.on_message(&Message::Activate(1));
    assert_eq!(flags(&knee.tick(DT, &standing())), [(GaitEvent::Boundary, 1)]);
    assert_eq!(generation(&knee), 1);
}

#[test]
fn an_older_generation_is_ignored() {
    let mut knee = node(NodeId::Knee);
    knee.on_message(&stage(5));
    knee.on_message(&Message::Activate(5));
    knee.tick(DT, &standing());
    assert_eq!(knee.on_message(&stage(4)), None);
    assert!(knee.on_message(&stage(5)).is_some(), "what is in force is acknowledged again");
}

#[test]
fn parameters_never_change_inside_a_cycle() {
    let mut knee = standing_knee();
    knee.on_message(&armed(1.0));
    let out = knee.tick(DT, &standing());
    assert_eq!(flags(&out), [(GaitEvent::CycleStart, 0)]);
    let kick = out.drive;
    knee.on_message(&stage(1));
    knee.on_message(&Message::Activate(1));
    let mut ended = false;
    for _ in 0..2_000 {
        knee.on_message(&armed(0.0));
        let out = knee.tick(DT, &standing());
        let raised = flags(&out);
        if !ended && raised.iter().all(|f| f.0 != GaitEvent::CycleEnd) {
            assert_eq!(generation(&knee), 0, "swapped inside the cycle");
            if out.drive[0] != Drive::Brake
                && matches!((out.drive[0], kick[0]), (Drive::Velocity(a), Drive::Velocity(b)) if a.signum() == b.signum() && a.abs() < Q16::lit(0.6))
            {
                assert_eq!(out.drive, kick);
            }
        }
        ended |= raised.iter().any(|f| f.0 == GaitEvent::CycleEnd);
        if raised.contains(&(GaitEvent::Boundary, 1)) {
            assert!(ended);
            return;
        }
    }
    panic!("never swapped");
}

#[test]
fn followers_swap_when_a_boundary_names_the_generation_and_not_before() {
    let mut hip = node(NodeId::Hip);
    hip.on_message(&armed(1.0));
    hip.on_message(&stage(1));
    hip.on_message(&Message::Activate(1));
    hip.on_message(&gait(GaitEvent::LiftOff, 1));
    assert_eq!(generation(&hip), 0);
    hip.on_message(&gait(GaitEvent::CycleStart, 1));
    assert_eq!(generation(&hip), 1);
}

#[test]
fn a_follower_without_the_named_generation_stays_braked_and_says_so() {
    let mut hip = node(NodeId::Hip);
    for message in [armed(1.0), gait(GaitEvent::CycleStart, 3), gait(GaitEvent::LiftOff, 3)] {
        hip.on_message(&message);
    }
    let out = hip.tick(DT, &standing());
    assert_eq!(out.drive, [Drive::Brake; 2]);
    assert_eq!(limits_of(&out), Some(limits::GENERATION_MISSING));
}

#[test]
fn nothing_moves_before_the_coordinator_armed() {
    let mut knee = node(NodeId::Knee);
    for _ in 0..1_000 {
        assert_eq!(knee.tick(DT, &standing()).drive, [Drive::Brake; 2]);
    }
    let Message::Motion(motion) = armed(2.0) else { unreachable!() };
    knee.on_message(&Message::Motion(Motion { mode: Mode::Braked, ..motion }));
    assert_eq!(knee.tick(DT, &standing()).drive, [Drive::Brake; 2]);
}

#[test]
fn a_halt_brakes_in_the_next_tick_and_outlives_armed_messages_under_way() {
    let mut knee = standing_knee();
    knee.on_message(&armed(1.0));
    assert_ne!(knee.tick(DT, &standing()).drive, [Drive::Brake; 2]);
    knee.on_message(&Message::Halt(HaltReason::EmergencyStop));
    knee.on_message(&armed(1.0));
    let out = knee.tick(DT, &standing());
    assert_eq!(out.drive, [Drive::Brake; 2]);
    assert_eq!(flags(&out), [(GaitEvent::CycleEnd, 0)]);
    for _ in 0..100 {
        knee.on_message(&armed(1.0));
        assert_eq!(knee.tick(DT, &standing()).drive, [Drive::Brake; 2]);
    }
}

#[test]
fn a_silent_coordinator_lets_the_cycle_finish_and_starts_no_other() {
    let mut knee = standing_knee();
    knee.on_message(&armed(1.0));
    let mut ended_at = None;
    for tick in 0..3_000 {
        let out = knee.tick(DT, &standing());
        let raised = flags(&out);
        if raised.iter().any(|f| f.0 == GaitEvent::CycleEnd) {
            ended_at = Some(tick);
        }
        if tick > 60 && ended_at.is_some() {
            assert_eq!(out.drive, [Drive::Brake; 2]);
            assert!(raised.iter().all(|f| f.0 != GaitEvent::CycleStart));
        }
    }
    assert!(ended_at.is_some_and(|tick| tick > 60), "the cycle was cut off at {ended_at:?} ms");
}

#[test]
fn an_impossible_position_is_replaced_by_the_last_good_one() {
    let mut hip = node(NodeId::Hip);
    for message in [armed(1.0), gait(GaitEvent::CycleStart, 0), gait(GaitEvent::LiftOff, 0)] {
        hip.on_message(&message);
    }
    let good = hip.tick(DT, &standing()).drive;
    let broken = Sensors { position: [Q16::MAX, Q16(i32::MIN)], ..standing() };
    assert_eq!(hip.tick(DT, &broken).drive, good);
}

proptest! {
    /// Any messages and sensors: no panic, no motion unless armed, one generation at a time.
    #[test]
    fn any_traffic_keeps_a_node_within_its_rules(
        script in prop::collection::vec((0u8..9, any::<u32>(), any::<[i32; 6]>(), any::<bool>()), 1..300),
        which in 0usize..3,
    ) {
        let mut node = node(NodeId::ALL[which]);
        let mut mode = Mode::Braked;
        for (kind, generation, numbers, flag) in script {
            let motion = Motion {
                mode: if flag { Mode::Armed } else { Mode::Braked },
                acceleration: Q16(numbers[0]), rotation: Q16(numbers[1]),
                slow_rate: [Q16(numbers[2]), Q16(numbers[3])], lean: [Q16(numbers[4]), Q16(numbers[5])],
                ..Motion::default()
            };
            let message = match kind {
                0 => Message::Halt(HaltReason::EmergencyStop),
                1 => Message::Activate(generation % 4),
                2 => stage(generation % 4),
                3..=6 => Message::Gait(Gait {
                    event: [GaitEvent::CycleStart, GaitEvent::LiftOff, GaitEvent::Touchdown, GaitEvent::CycleEnd][kind as usize - 3],
                    swing: if flag { Side::Left } else { Side::Right }, cycle: generation, generation: generation % 4,
                }),
                _ => Message::Motion(motion),
            };
            if let Message::Motion(m) = &message { mode = m.mode; }
            node.on_message(&message);
            let sensors = Sensors { position: [Q16(numbers[0]), Q16(numbers[1])], load: [Q16(numbers[2]), Q16(numbers[3]), Q16(numbers[4]), Q16(numbers[5])] };
            let out = node.tick(DT, &sensors);
            if mode == Mode::Braked || kind == 0 {
                prop_assert_eq!(out.drive, [Drive::Brake; 2]);
            }
            prop_assert!(out.messages.len() < out.messages.capacity(), "a message may have been dropped");
            let fastest = Q16::from_f32(SPECS.iter().filter(|s| s.unit.ends_with("m/s") || s.unit == "rad/s").fold(0.0, |m, s| s.max.max(m)));
            for d in out.drive {
                if let Drive::Velocity(v) = d { prop_assert!(v.abs() <= fastest); }
            }
        }
    }
}
