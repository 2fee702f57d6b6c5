//! The control code of a simulated robot, fed with the inputs on a tape; its outputs against the recorded ones.
//!
//! Each chip has its own order of inputs and outputs. The software in the loop records every output before the next
//! input of that chip, so an output that is missing or too many is found at once; an emulated chip's come later.

use std::collections::VecDeque;
use std::fmt::Debug;

use sarah_firmware::calibration::Counts;
use sarah_firmware::coordinator::{BusOutbox, Coordinator, HostOutbox, ImuSample};
use sarah_firmware::node::{Node, NodeKind};
use sarah_protocol::bus::{Frame, Message, NodeId, Status};
use sarah_protocol::params::ParamError;
use sarah_sim::body::calibration_of;
use sarah_sim::chips;

use super::Difference;
use crate::recording::tape::{Born, Framed, Passed, Told, node, told};

/// What has been compared.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Compared {
    /// Ticks of the nodes and turns of the coordinator.
    pub ticks: u64,
    /// Actuator commands.
    pub commands: u64,
    /// Frames for the bus.
    pub frames: u64,
    /// Bytes for the host.
    pub bytes: u64,
}

/// What a chip has put out in the replay and not yet on the tape.
#[derive(Default)]
struct Made {
    commands: VecDeque<[Told; 2]>,
    sent: VecDeque<Framed>,
    host: VecDeque<Vec<u8>>,
    stored: VecDeque<u32>,
}

/// The chips of a recording, running again.
pub struct Replayer {
    emulated: bool,
    coordinator: Coordinator,
    nodes: [NodeKind; 3],
    made: [Made; 4],
    ticks: [u64; 4],
    at_us: u64,
    compared: Compared,
}

impl Replayer {
    /// As they were born. An error if the recorded sets are not sets of this build.
    pub fn new(born: &Born) -> Result<Replayer, ParamError> {
        let birth = born.birth()?;
        Ok(Replayer {
            emulated: born.emulated,
            coordinator: birth.coordinator(),
            nodes: NodeId::ALL.map(|id| birth.node(id)),
            made: Default::default(),
            ticks: [0; 4],
            at_us: 0,
            compared: Compared::default(),
        })
    }

    /// The outputs on the tape are emulated chips'.
    pub fn emulated(&self) -> bool {
        self.emulated
    }

    /// The next entry of the tape.
    pub fn passed(&mut self, at_us: u64, chip: u8, what: Passed) -> Result<(), Difference> {
        self.at_us = at_us;
        let index = usize::from(chip).min(3);
        match what {
            Passed::Commands(recorded) => {
                self.compared.commands += 2;
                let replayed = self.made[index].commands.pop_front();
                self.same(chip, words_of_commands(&recorded), replayed.as_ref().map(words_of_commands))
            }
            Passed::Sent(recorded) => {
                self.compared.frames += 1;
                let replayed = self.made[index].sent.pop_front();
                let (recorded, replayed) = (self.comparable(recorded), replayed.map(|frame| self.comparable(frame)));
                if replayed.as_ref() == Some(&recorded) {
                    return Ok(());
                }
                self.same(chip, words_of_frame(&recorded), replayed.as_ref().map(words_of_frame))
            }
            Passed::Host(recorded) => {
                self.compared.bytes += recorded.len() as u64;
                let replayed = self.made[index].host.pop_front();
                match replayed.as_ref() == Some(&recorded) {
                    true => Ok(()),
                    false => self.same(chip, words_of_bytes(&recorded), replayed.as_deref().map(words_of_bytes)),
                }
            }
            Passed::Stored(recorded) => {
                let replayed = self.made[index].stored.pop_front();
                let words = |generation: u32| format!("generation {generation} in memory");
                self.same(chip, words(recorded), replayed.map(words))
            }
            input => {
                self.nothing_left(chip)?;
                self.feed(chip, input);
                Ok(())
            }
        }
    }

    /// The end of the tape.
    pub fn finish(self) -> Result<Compared, Difference> {
        for chip in 0..4 {
            self.nothing_left(chip)?;
        }
        Ok(self.compared)
    }

    fn feed(&mut self, chip: u8, input: Passed) {
        let index = usize::from(chip).min(3);
        let made = &mut self.made[index];
        let now_us = self.at_us as u32;
        match (input, node(chip)) {
            (Passed::Frame(frame), None) => {
                let (mut bus, mut host) = (BusOutbox::new(), HostOutbox::new());
                self.coordinator.on_bus(now_us, &Frame::from(&frame), &mut bus, &mut host);
                made.drain(&mut bus, &mut host);
            }
            (Passed::Frame(frame), Some(id)) => {
                if let Ok(message) = Message::decode(&Frame::from(&frame))
                    && let Some(answer) = self.nodes[id as usize].on_message(&message)
                {
                    made.sent.push_back((&answer.encode()).into());
                }
            }
            (Passed::Turn { host: bytes, accel, gyro }, None) => {
                self.ticks[index] += 1;
                self.compared.ticks += 1;
                let (mut bus, mut host) = (BusOutbox::new(), HostOutbox::new());
                let sample = ImuSample { accel, gyro };
                let stored = chips::turn(&mut self.coordinator, now_us, &bytes, &sample, &mut bus, &mut host);
                made.stored.extend(stored.map(|(generation, _)| generation));
                made.drain(&mut bus, &mut host);
            }
            (Passed::Tick { dt_us, position, load }, Some(id)) => {
                self.ticks[index] += 1;
                self.compared.ticks += 1;
                let calibration = calibration_of(id);
                let sensors = calibration.sensors(&Counts { position, load });
                let out = self.nodes[id as usize].tick(dt_us, &sensors);
                made.commands.push_back(out.drive.map(|drive| told(calibration.command(drive))));
                made.sent.extend(out.messages.iter().map(|message| Framed::from(&message.encode())));
            }
            // No chip has such an input: its outputs will be missed.
            _ => {}
        }
    }

    /// Emulated chips draw their own boot nonce.
    fn comparable(&self, frame: Framed) -> Framed {
        match Message::decode(&Frame::from(&frame)) {
            Ok(Message::Status(node, status)) if self.emulated => {
                (&Message::Status(node, Status { boot_nonce: 0, ..status }).encode()).into()
            }
            _ => frame,
        }
    }

    fn same(&self, chip: u8, recorded: String, replayed: Option<String>) -> Result<(), Difference> {
        match replayed {
            Some(replayed) if replayed == recorded => Ok(()),
            replayed => Err(self.difference(chip, recorded, replayed.unwrap_or_else(|| "nothing".into()))),
        }
    }

    fn nothing_left(&self, chip: u8) -> Result<(), Difference> {
        if self.emulated {
            return Ok(());
        }
        let made = &self.made[usize::from(chip).min(3)];
        let words = (made.commands.front().map(words_of_commands))
            .or_else(|| made.sent.front().map(words_of_frame))
            .or_else(|| made.host.front().map(|bytes| words_of_bytes(bytes)))
            .or_else(|| made.stored.front().map(|generation| format!("generation {generation} in memory")));
        words.map_or(Ok(()), |replayed| Err(self.difference(chip, "nothing".into(), replayed)))
    }

    fn difference(&self, chip: u8, recorded: String, replayed: String) -> Difference {
        let tick = self.ticks[usize::from(chip).min(3)];
        Difference { node: node(chip), tick, at_us: self.at_us, recorded, replayed }
    }
}

impl Made {
    fn drain(&mut self, bus: &mut BusOutbox, host: &mut HostOutbox) {
        self.sent.extend(std::iter::from_fn(|| bus.pop()).map(|frame| Framed::from(&frame)));
        self.host.extend(std::iter::from_fn(|| host.pop()).map(|bytes| bytes.to_vec()));
    }
}

fn words_of_commands(commands: &[Told; 2]) -> String {
    let words = commands.map(|told| match told {
        None => "brake".to_owned(),
        Some((forward, duty)) => format!("{}{duty}", if forward { "+" } else { "-" }),
    });
    format!("commands {} and {}", words[0], words[1])
}

fn words_of_frame(framed: &Framed) -> String {
    match Message::decode(&Frame::from(framed)) {
        Ok(message) => debug(&message),
        Err(error) => error.to_string(),
    }
}

fn words_of_bytes(bytes: &[u8]) -> String {
    format!("{} bytes for the host: {bytes:02x?}", bytes.len())
}

fn debug(value: &impl Debug) -> String {
    format!("{value:?}")
}
