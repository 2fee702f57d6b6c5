use std::net::UdpSocket;
use std::time::{Duration, Instant};

use proptest::prelude::*;
use sarah_sim::robot::Geometry;

use super::*;

fn source() -> PoseSource {
    PoseSource::new(Odometry::new(Geometry::load().unwrap()))
}

fn datagram(t: f64, [x, y, z]: [f64; 3], yaw: f64) -> Vec<u8> {
    format!(r#"{{"t": {t}, "x": {x}, "y": {y}, "z": {z}, "yaw": {yaw}, "quality": 1}}"#).into_bytes()
}

/// A robot that stands still on both feet, at this time.
fn standing(ms: u32) -> Telemetry {
    Telemetry { time_us: ms * 1000, accel: [0, 0, 2048], loads: [800; 4], ..Telemetry::default() }
}

fn near(a: [f32; 3], b: [f32; 3]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4)
}

#[test]
fn the_first_pose_moves_nothing_and_the_next_ones_are_followed() {
    let mut source = source();
    let start = source.saw(0.0, &standing(0)).pose.position_m;
    // Somewhere else, and turned by a right angle: its y is our −x.
    source.heard(0.0, &datagram(5.0, [3.0, 4.0, 1.0], std::f64::consts::FRAC_PI_2)).unwrap();
    assert!(near(source.estimate().pose.position_m, start));
    source.heard(0.05, &datagram(5.05, [3.0, 4.03, 1.01], std::f64::consts::FRAC_PI_2 + 0.1)).unwrap();
    let moved = source.estimate();
    assert!(near(moved.pose.position_m, [start[0] + 0.03, start[1], start[2] + 0.01]), "{moved:?}");
    assert!((moved.yaw_rad - 0.1).abs() < 1e-4);
    assert!(source.external());
}

#[test]
fn a_lost_source_leaves_the_robot_where_it_last_saw_it() {
    let mut source = source();
    let start = source.saw(0.0, &standing(0)).pose.position_m;
    for (t, x) in [(0.0, 0.0), (0.1, 0.05), (0.2, 0.1)] {
        source.heard(t, &datagram(t, [x, 0.0, 0.5], 0.0)).unwrap();
    }
    let estimate = source.saw(0.5, &standing(500));
    assert!(!source.external());
    assert!(near(estimate.pose.position_m, [start[0] + 0.1, start[1], start[2]]));
    // Back with another frame: no jump.
    source.heard(0.6, &datagram(0.01, [-7.0, 2.0, 9.0], 1.0)).unwrap();
    assert!(near(source.estimate().pose.position_m, estimate.pose.position_m));
    assert!(source.external());
}

#[test]
fn poses_that_jump_or_come_late_are_refused_and_change_nothing() {
    let mut source = source();
    source.saw(0.0, &standing(0));
    source.heard(0.0, &datagram(1.0, [0.0; 3], 0.0)).unwrap();
    let before = source.estimate();
    let jump = source.heard(0.01, &datagram(1.01, [0.5, 0.0, 0.0], 0.0));
    assert!(matches!(jump, Err(PoseError::Jump { .. })), "{jump:?}");
    let spin = source.heard(0.01, &datagram(1.01, [0.0; 3], 1.5));
    assert!(matches!(spin, Err(PoseError::Jump { .. })), "{spin:?}");
    let late = source.heard(0.01, &datagram(1.0, [0.01, 0.0, 0.0], 0.0));
    assert!(matches!(late, Err(PoseError::Late { .. })), "{late:?}");
    assert_eq!(source.estimate(), before);
}

#[test]
fn a_heading_that_wraps_is_a_small_turn() {
    let mut source = source();
    source.saw(0.0, &standing(0));
    source.heard(0.0, &datagram(1.0, [0.0; 3], 3.1)).unwrap();
    source.heard(0.01, &datagram(1.01, [0.0; 3], 3.15 - std::f64::consts::TAU)).unwrap();
    assert!((source.estimate().yaw_rad - 0.05).abs() < 1e-4, "{:?}", source.estimate());
}

#[test]
fn what_is_no_pose_is_refused_by_name() {
    let refused = |text: &str| Message::parse(text.as_bytes()).unwrap_err().to_string();
    assert!(refused("").contains("not a pose"));
    assert!(refused(r#"{"t": 1, "x": 0, "y": 0, "z": 0, "yaw": 0}"#).contains("quality"));
    assert!(refused(r#"{"t": 1, "x": 1e9, "y": 0, "z": 0, "yaw": 0, "quality": 1}"#).contains("x = "));
    assert!(refused(r#"{"t": 1, "x": 1e999, "y": 0, "z": 0, "yaw": 0, "quality": 1}"#).contains("not a pose"));
    assert!(refused(r#"{"t": 1, "x": 0, "y": 0, "z": 0, "yaw": 0, "quality": 0.2}"#).contains("quality 0.2"));
    let more = r#"{"t": 1, "x": 0, "y": 0, "z": 0, "yaw": 0, "quality": 1, "roll": 0.1}"#;
    assert!(Message::parse(more.as_bytes()).is_ok());
}

#[test]
fn a_reset_begins_at_the_origin_again() {
    let mut source = source();
    source.saw(0.0, &standing(0));
    source.heard(0.0, &datagram(0.0, [0.0; 3], 0.0)).unwrap();
    source.heard(0.1, &datagram(0.1, [0.1, 0.0, 0.0], 0.0)).unwrap();
    source.reset();
    let [x, y, _] = source.saw(0.2, &standing(200)).pose.position_m;
    assert_eq!([x, y], [0.0; 2]);
    assert!(!source.external());
}

#[test]
fn datagrams_arrive_in_order_and_an_empty_socket_does_not_wait() {
    let socket = PoseSocket::bind("127.0.0.1:0").unwrap();
    let began = Instant::now();
    socket.receive(|_| panic!("nothing was sent")).unwrap();
    assert!(began.elapsed() < Duration::from_millis(100));
    let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
    for n in 0..3_u8 {
        sender.send_to(&[n], socket.address().unwrap()).unwrap();
    }
    let mut seen = vec![];
    while seen.len() < 3 && began.elapsed() < Duration::from_secs(5) {
        socket.receive(|datagram| seen.push(datagram.to_vec())).unwrap();
    }
    assert_eq!(seen, [[0], [1], [2]]);
}

proptest! {
    #[test]
    fn any_datagram_leaves_a_finite_pose(
        bytes in proptest::collection::vec(any::<u8>(), 0..64),
        poses in proptest::collection::vec((-1e13..1e13, any::<[f64; 3]>(), any::<f64>(), 0.0..2.0), 0..20),
    ) {
        let mut source = source();
        source.saw(0.0, &standing(0));
        let _ = source.heard(0.0, &bytes);
        for (i, (t, at, yaw, wait)) in poses.into_iter().enumerate() {
            let _ = source.heard(i as f64 * wait, &datagram(t, at, yaw));
            let estimate = source.saw(i as f64 * wait, &standing(10 * i as u32));
            prop_assert!(estimate.pose.position_m.iter().all(|metres| metres.is_finite()));
            prop_assert!(estimate.yaw_rad.is_finite());
        }
    }
}
