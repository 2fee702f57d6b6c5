//! Promise 10: golden bytes. Whoever changes one of these changes the wire: old and new builds no longer understand
//! each other, so `WIRE_DIGEST` (and with it the schema hash) has to change too, and a test here insists on it.

mod samples;

use samples::{bus_messages, hex, host_frames};
use sarah_protocol::schema::WIRE_DIGEST;

fn table(rows: Vec<(&'static str, String)>) -> String {
    rows.into_iter().map(|(name, bytes)| format!("{name}: {bytes}\n")).collect()
}

#[test]
fn promise_10_golden_bytes_of_every_host_message() {
    let rows = host_frames().into_iter().map(|(name, bytes)| (name, hex(&bytes))).collect();
    insta::assert_snapshot!("host", table(rows));
}

#[test]
fn promise_10_golden_bytes_of_every_bus_message() {
    let rows = bus_messages()
        .into_iter()
        .map(|(name, message)| {
            let frame = message.encode();
            (name, format!("{:03x} {}", frame.id, hex(&frame.data)))
        })
        .collect();
    insta::assert_snapshot!("bus", table(rows));
}

#[test]
fn promise_10_a_changed_wire_changes_the_schema_hash() {
    let all: Vec<u8> = host_frames().into_iter().flat_map(|(_, bytes)| bytes).collect();
    let digest = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&all);
    assert_eq!(digest, WIRE_DIGEST, "the wire changed: write {digest:#010x} to schema::WIRE_DIGEST");
}
