//! Random frames, bytes and times: no panic, and never motion that nobody asked for.

use proptest::prelude::*;

use super::*;

#[derive(Clone, Debug)]
enum Input {
    Bus(u16, Vec<u8>),
    Bytes(Vec<u8>),
    Command(u16, u8, u32),
    Stop,
    Imu([i16; 3], [i16; 3]),
    Node(u8, u32, u16),
    Tick,
}

fn input() -> impl Strategy<Value = Input> {
    prop_oneof![
        (any::<u16>(), prop::collection::vec(any::<u8>(), 0..=64)).prop_map(|(id, data)| Input::Bus(id, data)),
        prop::collection::vec(any::<u8>(), 0..300).prop_map(Input::Bytes),
        (0u16..3, 0u8..12, 0u32..4).prop_map(|(session, which, generation)| Input::Command(session, which, generation)),
        Just(Input::Stop),
        (any::<[i16; 3]>(), any::<[i16; 3]>()).prop_map(|(accel, gyro)| Input::Imu(accel, gyro)),
        (0u8..3, 0u32..4, 0u16..3).prop_map(|(node, applied, nonce)| Input::Node(node, applied, nonce)),
        Just(Input::Tick),
    ]
}

fn command(which: u8, generation: u32) -> Command {
    match which {
        0 => Command::Claim,
        1 => Command::Release,
        2 => Command::Arm { boot_nonce: NONCE },
        3 => Command::Disarm,
        4 => Command::ClearEStop,
        5 => Command::Stage { generation, params: *other_set(0.1).values() },
        6 => Command::Commit { generation },
        7 => Command::Persist { generation },
        8 => Command::SetTelemetry { rate_hz: 50 },
        9 => Command::Heartbeat { host_us: generation },
        10 => Command::GetParams(Which::Staged),
        _ => Command::Stage { generation, params: [f32::NAN; 13] },
    }
}

proptest! {
    #[test]
    fn any_input_is_survived_and_motion_follows_only_an_arm(
        inputs in prop::collection::vec((input(), prop_oneof![0u32..20_000, any::<u32>()]), 0..150),
        start in any::<u32>(),
        gentle: bool,
    ) {
        // Strange input alone hardly ever gets a robot armed: half of the cases begin with one that is, and leave its nodes
        // as they are.
        let rig = if gentle { Rig::armed(config()) } else { Rig::at(config(), start) };
        let Rig { mut coordinator, mut bus, mut host, mut now, .. } = rig;
        let mut armed = gentle;
        for (sequence, (input, dt)) in inputs.into_iter().enumerate() {
            let sequence = 1000 + sequence as u16;
            let dt = if gentle { dt % 5_000 } else { dt };
            now = now.wrapping_add(dt);
            match input {
                Input::Bus(id, data) => {
                    let data = heapless::Vec::from_slice(&data).expect("64 bytes");
                    coordinator.on_bus(now, &Frame { id, data }, &mut bus, &mut host);
                }
                Input::Bytes(bytes) => coordinator.on_host_bytes(now, &bytes, &mut bus, &mut host),
                Input::Command(session, which, generation) => {
                    let command = command(which, generation);
                    armed |= matches!(command, Command::Arm { .. });
                    let bytes = ToRobot::Command(command).encode(session, sequence).expect("fits");
                    coordinator.on_host_bytes(now, &bytes, &mut bus, &mut host);
                }
                Input::Stop => {
                    let bytes = ToRobot::EStop.encode(0, sequence).expect("fits");
                    coordinator.on_host_bytes(now, &bytes, &mut bus, &mut host);
                    armed = false;
                    prop_assert_eq!(coordinator.mode(), Mode::Braked);
                }
                Input::Imu(accel, gyro) => coordinator.on_imu(now, &ImuSample { accel, gyro }, &mut bus),
                Input::Node(node, applied, boot_nonce) => {
                    let id = NodeId::ALL[node as usize];
                    let (applied, boot_nonce) = if gentle { (0, 1) } else { (applied, boot_nonce) };
                    let status = FakeNode { applied: (applied, default_set()), nonce: boot_nonce, ..FakeNode::new(id, default_set()) }
                        .tick()
                        .pop()
                        .expect("a status");
                    coordinator.on_bus(now, &status.encode(), &mut bus, &mut host);
                }
                Input::Tick => {
                    if let Some(Action::Store(_, generation)) = coordinator.tick(now, &mut bus, &mut host) {
                        coordinator.on_stored(generation, dt % 2 == 0, &mut host);
                    }
                }
            }
            prop_assert!(armed || coordinator.mode() == Mode::Braked);
            if dt % 3 == 0 {
                while let Some(frame) = bus.pop() {
                    let message = Message::decode(&frame);
                    prop_assert!(message.is_ok());
                    if let Ok(Message::Motion(motion)) = message {
                        prop_assert!(armed || motion.mode == Mode::Braked);
                    }
                }
                while host.pop().is_some() {}
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn whatever_fails_and_returns_a_halted_robot_stays_halted_without_an_arm(
        happenings in prop::collection::vec((0u8..9, 0usize..3, 1u32..400), 1..25),
    ) {
        let mut rig = Rig::armed(Config { arm_at_boot: true, ..config() });
        let mut halted = false;
        for (what, node, millis) in happenings {
            match what {
                0 => rig.nodes[node].mute ^= true,
                1 => rig.nodes[node].restart(),
                2 => rig.imu ^= true,
                3 => rig.host_connected ^= true,
                4 => rig.session.e_stop(),
                5 => rig.session.disarm(),
                6 => drop(rig.session.clear_e_stop()),
                7 => drop(rig.session.apply(&other_set(0.01 * millis as f32 / 40.0))),
                _ => rig.nodes[0].in_cycle ^= true,
            }
            for _ in 0..millis {
                rig.step();
                let braked = rig.coordinator.mode() == Mode::Braked;
                prop_assert!(!halted || braked);
                halted |= braked;
            }
            if what == 4 && rig.host_connected {
                prop_assert!(halted);
            }
        }
    }
}
