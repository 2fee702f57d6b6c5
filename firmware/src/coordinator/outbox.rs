//! What waits to be sent. Bounded; when full, the news of yesterday goes, never a command.
//!
//! ```text
//!  bus    halt [1]  ►  commands [4]  ►  motion [1, newest wins]
//!  host   replies and events [512 bytes, some 10]  ►  telemetry [1, newest is dropped and counted]
//! ```

use heapless::Deque;
use sarah_protocol::bus::{Frame, HaltReason, Message, Motion};
use sarah_protocol::frame::Bytes;

/// Frames for the nodes, most urgent first.
#[derive(Clone, Debug, Default)]
pub struct BusOutbox {
    halt: Option<HaltReason>,
    commands: Deque<Message, 4>,
    motion: Option<Motion>,
}

impl BusOutbox {
    /// Empty.
    pub const fn new() -> Self {
        BusOutbox { halt: None, commands: Deque::new(), motion: None }
    }

    /// Brakes now: takes back a motion message that has not left yet.
    pub fn halt(&mut self, reason: HaltReason) {
        self.halt = Some(reason);
        self.motion = None;
    }

    /// The newest IMU products.
    pub fn motion(&mut self, motion: Motion) {
        self.motion = Some(motion);
    }

    /// A staging or activation. False if there is no room: its sender repeats it anyway.
    pub fn command(&mut self, message: Message) -> bool {
        self.commands.push_back(message).is_ok()
    }

    /// Takes the most urgent frame.
    pub fn pop(&mut self) -> Option<Frame> {
        let message = if let Some(reason) = self.halt.take() {
            Message::Halt(reason)
        } else if let Some(command) = self.commands.pop_front() {
            command
        } else {
            Message::Motion(self.motion.take()?)
        };
        Some(message.encode())
    }
}

/// Bytes of replies and events that may wait: most take less than 50, none more than 204.
const REPLY_BYTES: usize = 512;

/// Frames for the host, replies first.
#[derive(Clone, Debug, Default)]
pub struct HostOutbox {
    /// Whole frames, one after the other: their delimiters tell them apart.
    replies: Deque<u8, REPLY_BYTES>,
    telemetry: Option<Bytes>,
}

impl HostOutbox {
    /// Empty.
    pub const fn new() -> Self {
        HostOutbox { replies: Deque::new(), telemetry: None }
    }

    /// An answer or an event.
    pub fn reply(&mut self, bytes: Bytes) {
        if self.replies.capacity() - self.replies.len() < bytes.len() {
            // A host repeats what it gets no reply to.
            return;
        }
        for byte in bytes {
            // There is room: see above.
            let _ = self.replies.push_back(byte);
        }
    }

    /// Whether a telemetry frame would be taken.
    pub fn wants_telemetry(&self) -> bool {
        self.telemetry.is_none()
    }

    /// A telemetry frame, sent when no reply waits.
    pub fn telemetry(&mut self, bytes: Bytes) {
        self.telemetry = Some(bytes);
    }

    /// Takes the next frame.
    pub fn pop(&mut self) -> Option<Bytes> {
        let mut frame = Bytes::new();
        while let Some(byte) = self.replies.pop_front() {
            let ends = byte == 0 && !frame.is_empty();
            // It went in as a frame, so it fits.
            let _ = frame.push(byte);
            if ends {
                return Some(frame);
            }
        }
        // Not taken when there is none: that would copy two hundred bytes of nothing.
        self.telemetry.as_ref()?;
        self.telemetry.take()
    }
}
