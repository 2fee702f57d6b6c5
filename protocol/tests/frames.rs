//! Promises 1, 2 and 8 of the serial link.

mod samples;

use proptest::prelude::*;
use samples::{HELLO, REPLY, commands, host_frames, reports};
use sarah_protocol::frame::{self, Deframer, FrameError, Header, MAX_BODY, MAX_ENCODED};
use sarah_protocol::host::{Hello, MessageError, ToHost, ToRobot, VERSION};

type Heard = Result<(Header, Vec<u8>), FrameError>;

fn hear(deframer: &mut Deframer, bytes: &[u8]) -> Vec<Heard> {
    let mut heard = Vec::new();
    for byte in bytes {
        if let Some(result) = deframer.push(*byte) {
            heard.push(result.map(|packet| (packet.header, packet.body.to_vec())));
        }
    }
    heard
}

fn one(bytes: &[u8]) -> (Header, Vec<u8>) {
    let heard = hear(&mut Deframer::new(), bytes);
    assert_eq!(heard.len(), 1);
    heard.into_iter().next().expect("one frame").expect("good frame")
}

fn header() -> Header {
    Header { version: VERSION, session: 0xbeef, sequence: 77 }
}

#[test]
fn every_message_comes_back_as_it_was_sent() {
    for (_, command) in commands() {
        let (header, body) = one(&ToRobot::Command(command).encode(7, 8).expect("fits"));
        assert_eq!((header.session, header.sequence), (7, 8));
        let packet = frame::Packet { header, body: &body };
        assert_eq!(ToRobot::decode(&packet), Ok(ToRobot::Command(command)));
    }
    for (_, report) in reports() {
        let (header, body) = one(&ToHost::Report(report).encode(7, 8).expect("fits"));
        assert_eq!(ToHost::decode(&frame::Packet { header, body: &body }), Ok(ToHost::Report(report)));
    }
}

#[test]
fn promise_1_a_flipped_bit_anywhere_is_noticed_before_decoding() {
    for (name, bytes) in host_frames() {
        for bit in 8..(bytes.len() - 1) * 8 {
            let mut broken = bytes.clone();
            broken[bit / 8] ^= 1 << (bit % 8);
            let good = hear(&mut Deframer::new(), &broken).into_iter().filter(Result::is_ok).count();
            assert_eq!(good, 0, "{name}, bit {bit}");
        }
    }
}

#[test]
fn promise_1_the_check_sum_covers_the_header() {
    let bytes = frame::encode(header(), b"body").expect("fits");
    // 00, COBS code, version, session: flip a bit of the session.
    let mut broken = bytes.clone();
    broken[3] ^= 2;
    assert_eq!(hear(&mut Deframer::new(), &broken), [Err(FrameError::Crc)]);
}

#[test]
fn promise_2_the_hello_of_any_version_is_understood() {
    let newer = Hello { version: 200, schema: 1 };
    let (header, body) = one(&ToRobot::Hello(newer).encode(1, 1).expect("fits"));
    assert_eq!(header.version, 0);
    assert_eq!(ToRobot::decode(&frame::Packet { header, body: &body }), Ok(ToRobot::Hello(newer)));
}

#[test]
fn promise_2_a_hello_that_grew_is_still_understood() {
    let (header, mut body) = one(&ToHost::Hello(REPLY).encode(1, 1).expect("fits"));
    body.extend_from_slice(b"whatever a later build adds");
    assert_eq!(ToHost::decode(&frame::Packet { header, body: &body }), Ok(ToHost::Hello(REPLY)));
    let (header, mut body) = one(&ToRobot::Hello(HELLO).encode(1, 1).expect("fits"));
    body.push(9);
    assert_eq!(ToRobot::decode(&frame::Packet { header, body: &body }), Ok(ToRobot::Hello(HELLO)));
}

#[test]
fn promise_2_another_version_is_a_named_error() {
    let header = Header { version: VERSION + 1, ..header() };
    let packet = frame::Packet { header, body: &[1, 2, 3] };
    assert_eq!(ToRobot::decode(&packet), Err(MessageError::Version(VERSION + 1)));
    assert_eq!(MessageError::Version(2).to_string(), "protocol version 2, here 1");
}

#[test]
fn a_half_frame_costs_only_itself() {
    let good = frame::encode(header(), b"body").expect("fits");
    let mut stream = good[..good.len() / 2].to_vec();
    stream.extend_from_slice(&good);
    let heard = hear(&mut Deframer::new(), &stream);
    assert_eq!(heard.len(), 2);
    assert!(heard[0].is_err());
    assert_eq!(heard[1], Ok((header(), b"body".to_vec())));
}

#[test]
fn an_overlong_frame_is_named_and_the_next_one_is_heard() {
    let mut stream = vec![0x55; 10 * MAX_ENCODED];
    stream.extend_from_slice(&frame::encode(header(), b"body").expect("fits"));
    let heard = hear(&mut Deframer::new(), &stream);
    assert_eq!(heard, [Err(FrameError::TooLong), Ok((header(), b"body".to_vec()))]);
}

#[test]
fn frames_shorter_than_a_header_are_named() {
    assert_eq!(hear(&mut Deframer::new(), &[3, 1, 1, 0]), [Err(FrameError::TooShort)]);
    assert_eq!(hear(&mut Deframer::new(), &[0, 0, 0]), []);
}

#[test]
fn the_longest_body_fits_and_a_longer_one_is_refused() {
    let body = [0xff; MAX_BODY + 1];
    let longest = frame::encode(header(), &body[..MAX_BODY]).expect("fits");
    assert_eq!(longest.len(), MAX_ENCODED);
    assert_eq!(one(&longest).1.len(), MAX_BODY);
    assert!(frame::encode(header(), &body).is_none());
}

#[test]
fn the_longest_telemetry_fits() {
    use sarah_protocol::{
        bus::Mode,
        fixed::Q16,
        host::Report,
        telemetry::{ResetCause, Telemetry},
    };
    let q = Q16(i32::MIN);
    let telemetry = Telemetry {
        time_us: u32::MAX,
        accel: [i16::MIN; 3],
        gyro: [i16::MIN; 3],
        gyro_bias: [i16::MIN; 3],
        loads: [u16::MAX; 4],
        joints: [q; 6],
        lean: [q; 2],
        phases: [255; 3],
        factor: q,
        steps: u32::MAX,
        cycle: u32::MAX,
        generation: u32::MAX,
        generation_age_ms: u32::MAX,
        stale: true,
        mode: Mode::Armed,
        faults: u16::MAX,
        limits: [u16::MAX; 3],
        reset_cause: ResetCause::Software,
        dropped: u32::MAX,
    };
    assert!(ToHost::Report(Report::Telemetry(telemetry)).encode(u16::MAX, u16::MAX).is_some());
}

proptest! {
    #[test]
    fn promise_8_any_bytes_decode_without_panic_and_leave_the_deframer_usable(
        chunks in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..600), 0..8),
    ) {
        let mut deframer = Deframer::new();
        for heard in chunks.iter().flat_map(|chunk| hear(&mut deframer, chunk)).flatten() {
            let packet = frame::Packet { header: heard.0, body: &heard.1 };
            let _ = (ToRobot::decode(&packet), ToHost::decode(&packet));
        }
        let good = frame::encode(header(), b"body").expect("fits");
        prop_assert_eq!(hear(&mut deframer, &good).pop(), Some(Ok((header(), b"body".to_vec()))));
    }

    #[test]
    fn promise_8_any_body_decodes_without_panic(
        version in 0u8..3,
        body in prop::collection::vec(any::<u8>(), 0..=MAX_BODY),
    ) {
        let packet = frame::Packet { header: Header { version, ..header() }, body: &body };
        let _ = (ToRobot::decode(&packet), ToHost::decode(&packet));
    }

    #[test]
    fn any_body_survives_the_link(body in prop::collection::vec(any::<u8>(), 0..=MAX_BODY)) {
        let bytes = frame::encode(header(), &body).expect("fits");
        prop_assert_eq!(one(&bytes), (header(), body));
    }
}
