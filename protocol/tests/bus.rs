//! CAN-FD frames: padded to lengths the bus knows, and total to decode.

mod samples;

use proptest::prelude::*;
use samples::{bus_messages, longest_bus_messages};
use sarah_protocol::bus::{BusError, Frame, MAX_PAYLOAD, Message};

const LENGTHS: [usize; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];

fn frame(id: u16, data: &[u8]) -> Frame {
    Frame { id, data: heapless::Vec::from_slice(data).expect("at most 64 bytes") }
}

#[test]
fn every_message_comes_back_as_it_was_sent() {
    for message in bus_messages().into_iter().map(|(_, message)| message).chain(longest_bus_messages()) {
        assert_eq!(Message::decode(&message.encode()), Ok(message));
    }
}

#[test]
fn every_payload_has_a_length_can_fd_knows() {
    for message in bus_messages().into_iter().map(|(_, message)| message).chain(longest_bus_messages()) {
        let length = message.encode().data.len();
        assert!(LENGTHS.contains(&length), "{length}");
        assert!(length > 0, "a message that does not fit is sent empty");
    }
}

#[test]
fn the_longest_message_fits_a_frame() {
    let longest = longest_bus_messages().iter().map(|message| message.encode().data.len()).max();
    assert_eq!(longest, Some(MAX_PAYLOAD));
}

#[test]
fn after_a_message_only_zeros_are_accepted() {
    let mut sent = Message::Activate(300).encode();
    sent.data.extend_from_slice(&[0, 0]).expect("fits");
    assert_eq!(Message::decode(&sent), Ok(Message::Activate(300)));
    sent.data.push(1).expect("fits");
    assert_eq!(Message::decode(&sent), Err(BusError::Malformed(sent.id)));
}

#[test]
fn an_identifier_of_nobody_is_named() {
    assert_eq!(Message::decode(&frame(0x123, &[])), Err(BusError::UnknownId(0x123)));
    assert_eq!(Message::decode(&frame(0x063, &[])), Err(BusError::UnknownId(0x063)));
}

proptest! {
    #[test]
    fn promise_8_decoding_a_frame_is_total(id in any::<u16>(), data in prop::collection::vec(any::<u8>(), 0..=64)) {
        let _ = Message::decode(&frame(id, &data));
    }

    #[test]
    fn promise_8_decoding_a_known_identifier_is_total(
        id in prop::sample::select(vec![0x10u16, 0x20, 0x30, 0x40, 0x50, 0x60, 0x61, 0x62, 0x100, 0x101, 0x102]),
        data in prop::collection::vec(any::<u8>(), 0..=64),
    ) {
        if let Ok(message) = Message::decode(&frame(id, &data)) {
            prop_assert_eq!(message.encode().id, id);
        }
    }
}
