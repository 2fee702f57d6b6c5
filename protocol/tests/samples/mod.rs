//! One example of every message, with every variant of its enums somewhere.
#![allow(dead_code, missing_docs)]

use sarah_protocol::bus::{Gait, GaitEvent, HaltReason, Message, Mode, Motion, NodeId, Side, Stage, Staged, Status};
use sarah_protocol::fixed::Q16;
use sarah_protocol::host::{
    Ack, AckState, Command, Hello, HelloReply, NotReady, ParamsReport, Refusal, Report, ToHost, ToRobot, Which,
};
use sarah_protocol::params::{ParamError, RawParams};
use sarah_protocol::telemetry::{Event, ResetCause, Telemetry};

pub const PARAMS: RawParams = [0.5, 0.25, 0.75, 0.125, 1.0, 0.1, 0.2, 3.0, 0.3, 2.0, 0.4, 0.6, 4.0];

pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

pub fn commands() -> Vec<(&'static str, Command)> {
    vec![
        ("claim", Command::Claim),
        ("release", Command::Release),
        ("arm", Command::Arm { boot_nonce: 0xdead_beef }),
        ("disarm", Command::Disarm),
        ("clear", Command::ClearEStop),
        ("stage", Command::Stage { generation: 300, params: PARAMS }),
        ("commit", Command::Commit { generation: 300 }),
        ("persist", Command::Persist { generation: 300 }),
        ("get applied", Command::GetParams(Which::Applied)),
        ("get stored", Command::GetParams(Which::Stored)),
        ("get staged", Command::GetParams(Which::Staged)),
        ("heartbeat", Command::Heartbeat { host_us: 1_000_000 }),
        ("telemetry rate", Command::SetTelemetry { rate_hz: 100 }),
    ]
}

pub fn telemetry() -> Telemetry {
    Telemetry {
        time_us: 0x8000_0001,
        accel: [-1, 2, 2048],
        gyro: [i16::MIN, 0, i16::MAX],
        gyro_bias: [10, 0, -94],
        loads: [1, 200, 30_000, u16::MAX],
        joints: [Q16(1), Q16(-1), Q16(100), Q16(-100), Q16(i32::MAX), Q16(i32::MIN)],
        lean: [Q16::lit(0.1), Q16::lit(-0.2)],
        phases: [0, 1, 255],
        factor: Q16::lit(0.0385),
        steps: 7,
        cycle: 9,
        generation: 300,
        generation_age_ms: 123_456,
        stale: true,
        mode: Mode::Armed,
        faults: 0x81,
        limits: [1, 2, 0x40],
        reset_cause: ResetCause::Watchdog,
        dropped: 5,
    }
}

pub fn refusals() -> Vec<Refusal> {
    vec![
        Refusal::NotClaimed,
        Refusal::Claimed { by: 0x1234 },
        Refusal::Params(ParamError::NotFinite { index: 3 }),
        Refusal::Params(ParamError::OutOfRange { index: 4, value: 9.0 }),
        Refusal::Node(NodeId::Hip, ParamError::TooFast { index: 12, change: -3.0 }),
        Refusal::Stale { newest: 301 },
        Refusal::Duplicate(300),
        Refusal::Busy(300),
        Refusal::NotStaged(300),
        Refusal::NotApplied { applied: 299 },
        Refusal::NodeSilent,
        Refusal::EStop,
        Refusal::NotReady(NotReady::Imu),
        Refusal::NotReady(NotReady::Node(NodeId::Abductor)),
        Refusal::NotReady(NotReady::Generations),
        Refusal::Rebooted { current: 1 },
        Refusal::Storage,
        Refusal::OutOfRange,
        Refusal::Malformed,
    ]
}

pub fn events() -> Vec<Event> {
    vec![
        Event::Armed,
        Event::Halted(HaltReason::EmergencyStop),
        Event::Halted(HaltReason::Disarmed),
        Event::Halted(HaltReason::NodeFault),
        Event::Halted(HaltReason::ImuLost),
        Event::EStopCleared,
        Event::NodeLost(NodeId::Knee),
        Event::NodeBack(NodeId::Hip),
        Event::NodeRestarted(NodeId::Abductor),
        Event::ImuBack,
        Event::WriterLapsed,
        Event::Applied { generation: 300, cycle: 17 },
        Event::Restaging { generation: 301 },
        Event::GenerationSplit(NodeId::Hip),
        Event::StagingFailed { generation: 300 },
    ]
}

pub fn reports() -> Vec<(&'static str, Report)> {
    let ack = |state| Report::Ack(Ack { request: 258, state });
    let mut all = vec![
        ("received", ack(AckState::Received)),
        ("staged", ack(AckState::Staged { generation: 300 })),
        ("applied", ack(AckState::Applied { generation: 300, cycle: 17 })),
        ("persisted", ack(AckState::Persisted { generation: 300 })),
        ("params", Report::Params(ParamsReport { which: Which::Stored, generation: 0, params: Some(PARAMS) })),
        ("no params", Report::Params(ParamsReport { which: Which::Staged, generation: 0, params: None })),
        ("telemetry", Report::Telemetry(telemetry())),
        ("quiet", Report::Telemetry(Telemetry::default())),
    ];
    all.extend(refusals().into_iter().map(|refusal| ("refused", ack(AckState::Refused(refusal)))));
    all.extend(events().into_iter().map(|event| ("event", Report::Event { time_us: 5, event })));
    all
}

/// The hash is not this build's, so that new parameter limits leave the golden bytes alone.
pub const HELLO: Hello = Hello { version: 1, schema: 0x0102_0304 };
pub const REPLY: HelloReply = HelloReply {
    version: 1,
    schema: 0x0102_0304,
    boot_nonce: 0xdead_beef,
    board: 2,
    nodes: 0b101,
    build: *b"0.1.0-abcdef\0\0\0\0",
};

pub fn host_frames() -> Vec<(&'static str, Vec<u8>)> {
    let bytes = |frame: Option<sarah_protocol::frame::Bytes>| frame.expect("fits").to_vec();
    let mut all = vec![
        ("hello", bytes(ToRobot::Hello(HELLO).encode(0x1234, 1))),
        ("hello reply", bytes(ToHost::Hello(REPLY).encode(0x1234, 2))),
        ("stop", bytes(ToRobot::EStop.encode(0x1234, 3))),
    ];
    all.extend(commands().into_iter().map(|(name, c)| (name, bytes(ToRobot::Command(c).encode(0x1234, 4)))));
    all.extend(reports().into_iter().map(|(name, r)| (name, bytes(ToHost::Report(r).encode(0x1234, 5)))));
    all
}

pub fn bus_messages() -> Vec<(&'static str, Message)> {
    let gait = |event, swing| Message::Gait(Gait { event, swing, cycle: 17, generation: 300 });
    let staged = |result| Message::Staged(NodeId::Abductor, Staged { generation: 300, result });
    vec![
        ("halt stop", Message::Halt(HaltReason::EmergencyStop)),
        ("halt disarmed", Message::Halt(HaltReason::Disarmed)),
        ("halt node", Message::Halt(HaltReason::NodeFault)),
        ("halt imu", Message::Halt(HaltReason::ImuLost)),
        ("cycle start", gait(GaitEvent::CycleStart, Side::Left)),
        ("lift-off", gait(GaitEvent::LiftOff, Side::Right)),
        ("touchdown", gait(GaitEvent::Touchdown, Side::Left)),
        ("cycle end", gait(GaitEvent::CycleEnd, Side::Left)),
        ("boundary", gait(GaitEvent::Boundary, Side::Left)),
        ("beat", gait(GaitEvent::Beat, Side::Left)),
        ("recovery", gait(GaitEvent::Recovery, Side::Right)),
        (
            "motion",
            Message::Motion(Motion {
                sequence: 1000,
                mode: Mode::Armed,
                acceleration: Q16::lit(9.81),
                rotation: Q16::lit(0.2),
                rate: [Q16::lit(0.5), Q16::lit(-0.5)],
                slow_rate: [Q16::lit(0.25), Q16::ZERO],
                lean: [Q16::lit(0.05), Q16::lit(-0.05)],
            }),
        ),
        ("activate", Message::Activate(300)),
        ("stage", Message::Stage(Stage { generation: 300, params: PARAMS })),
        ("staged", staged(Ok(()))),
        ("not finite", staged(Err(ParamError::NotFinite { index: 3 }))),
        ("out of range", staged(Err(ParamError::OutOfRange { index: 4, value: 9.0 }))),
        ("too fast", staged(Err(ParamError::TooFast { index: 12, change: -3.0 }))),
        (
            "status",
            Message::Status(
                NodeId::Knee,
                Status {
                    position: [Q16::lit(0.05), Q16::lit(-0.05)],
                    loads: [100, 200, 0, 30_000],
                    phase: 2,
                    factor: Q16::lit(0.0385),
                    steps: 7,
                    cycle: 17,
                    applied: 300,
                    staged: Some(301),
                    limits: 3,
                    boot_nonce: 0xbeef,
                },
            ),
        ),
    ]
}

/// The longest each message can get: every variable-length field at its longest.
pub fn longest_bus_messages() -> Vec<Message> {
    let q = Q16(i32::MIN);
    let raw = [f32::MIN; 13];
    vec![
        Message::Halt(HaltReason::ImuLost),
        Message::Gait(Gait { event: GaitEvent::Beat, swing: Side::Right, cycle: u32::MAX, generation: u32::MAX }),
        Message::Motion(Motion {
            sequence: u16::MAX,
            mode: Mode::Armed,
            acceleration: q,
            rotation: q,
            rate: [q; 2],
            slow_rate: [q; 2],
            lean: [q; 2],
        }),
        Message::Activate(u32::MAX),
        Message::Stage(Stage { generation: u32::MAX, params: raw }),
        Message::Staged(
            NodeId::Abductor,
            Staged { generation: u32::MAX, result: Err(ParamError::TooFast { index: u8::MAX, change: f32::MIN }) },
        ),
        Message::Status(
            NodeId::Abductor,
            Status {
                position: [q; 2],
                loads: [u16::MAX; 4],
                phase: u8::MAX,
                factor: q,
                steps: u32::MAX,
                cycle: u32::MAX,
                applied: u32::MAX,
                staged: Some(u32::MAX),
                limits: u16::MAX,
                boot_nonce: u16::MAX,
            },
        ),
    ]
}
