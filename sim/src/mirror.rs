//! The library beside the images: every tick of an emulated node is repeated by the library, and both must say the same.
//!
//! The chips' clocks, their interrupts and the bus decide *when* a tick happens and what it has heard by then; that is
//! theirs, and it is taken from them. Everything that follows from it must agree bit for bit:
//!
//! | taken from the chip, at the entry of its `control_tick` | compared |
//! |---|---|
//! | `dt_us`, the call's argument | what the timer is told for each actuator |
//! | the scan's counts, as DMA left them in memory | every frame the node sends, in order |
//! | whether the tick before took a message from the queue | |
//!
//! Messages are those that the bus delivered while the chip took part in it, in the order of the bus. A node's boot nonce
//! is the chip's own and not compared.

use std::collections::VecDeque;

use samc21::{Chip, Image, Width};
use sarah_firmware::board::samc21::wiring;
use sarah_firmware::calibration::{Command, Counts};
use sarah_firmware::default_params;
use sarah_firmware::node::{self, Node, NodeConfig, NodeKind};
use sarah_protocol::bus::{Frame, Message, NodeId};

use crate::body::calibration_of;
use crate::bus::Station;
use crate::tap::{Passing, Socket, Tap};

/// Function of an image that is one tick.
const TICK: &str = "sarah_firmware::board::samc21::node::control_tick";
/// Variables of an image.
const SCAN: &str = "sarah_firmware::board::samc21::adc::RESULTS";
/// The same, of the image's own crate.
const QUEUE: &str = "::TO_NODE";

/// What has been compared.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Compared {
    /// Ticks of all nodes.
    pub ticks: u64,
    /// Actuator commands.
    pub commands: u64,
    /// Frames.
    pub frames: u64,
}

/// The first thing on which chip and library differ.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Difference {
    /// Which node.
    pub node: NodeId,
    /// Its tick, from 1 at its start.
    pub tick: u64,
    /// When, µs since power-up.
    pub at_us: u64,
    /// What.
    pub what: String,
}

impl std::fmt::Display for Difference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}, tick {} at {:.4} s: {}", self.node, self.tick, self.at_us as f64 * 1e-6, self.what)
    }
}

/// The library's side of one node.
struct Twin {
    id: NodeId,
    node: NodeKind,
    entry: u32,
    scan: u32,
    /// The queue's counter of messages taken.
    taken_at: u32,
    taken: u32,
    ticks: u64,
    heard: VecDeque<Message>,
    expected: VecDeque<Message>,
    said: VecDeque<Message>,
    commands: [Command; 2],
}

/// The library's side of the three nodes.
pub struct Mirror {
    twins: [Twin; 3],
    compared: Compared,
    difference: Option<Difference>,
    tap: Socket,
}

/// An image lacks a name that comparing needs.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the {node:?} image has no `{name}`; build it with `cargo firmware` from this source")]
pub struct Nameless {
    /// Which image.
    pub node: NodeId,
    /// Which name.
    pub name: &'static str,
}

impl Mirror {
    /// Beside freshly started chips. `image` gives each node's.
    pub fn new(image: impl Fn(NodeId) -> Image) -> Result<Mirror, Nameless> {
        let twin = |id| Twin::new(id, &image(id));
        let [knee, hip, abductor] = NodeId::ALL;
        let twins = [twin(knee)?, twin(hip)?, twin(abductor)?];
        Ok(Mirror { twins, compared: Compared::default(), difference: None, tap: Socket::default() })
    }

    /// Connects `tap` to the nodes: their inputs are the library's, the outputs the chips'.
    pub fn set_tap(&mut self, tap: Box<dyn Tap>) {
        self.tap.connect(tap);
    }

    /// Where a node's chip must be watched.
    pub fn entry(&self, id: NodeId) -> u32 {
        self.twins[id as usize].entry
    }

    /// What has been compared so far.
    pub fn compared(&self) -> Compared {
        self.compared
    }

    /// The first difference.
    pub fn difference(&self) -> Option<&Difference> {
        self.difference.as_ref()
    }

    /// A frame has passed the bus; `to` says which nodes took part in it, other than its sender.
    pub fn passed(&mut self, sender: Option<NodeId>, frame: &Frame, to: impl Fn(NodeId) -> bool) {
        let accepted = wiring::NODE_ACCEPTS.iter().any(|(low, high)| (*low..=*high).contains(&frame.id));
        // What does not decode is dropped by the nodes too.
        let Ok(message) = Message::decode(frame) else { return };
        for twin in &mut self.twins {
            if sender == Some(twin.id) {
                twin.said.push_back(message);
            } else if accepted && to(twin.id) {
                twin.heard.push_back(message);
            }
        }
    }

    /// A node's chip is about to begin a tick. `commands` is what its timer has been told for the actuators.
    pub fn at_tick(&mut self, id: NodeId, chip: &Chip, commands: [Command; 2]) {
        if self.difference.is_some() {
            return;
        }
        let twin = &mut self.twins[id as usize];
        if let Err(what) = twin.check_last(chip, commands, &mut self.compared, &mut self.tap) {
            let at_us = chip.now().0 / 48;
            self.difference = Some(Difference { node: id, tick: twin.ticks, at_us, what });
            return;
        }
        twin.tick(chip, &mut self.tap);
        self.compared.ticks += 1;
    }
}

impl Twin {
    fn new(id: NodeId, image: &Image) -> Result<Twin, Nameless> {
        let named = |name, found: Option<u32>| found.ok_or(Nameless { node: id, name });
        let board = match id {
            NodeId::Knee => &wiring::KNEE,
            NodeId::Hip => &wiring::HIP,
            NodeId::Abductor => &wiring::ABDUCTOR,
        };
        let NodeConfig { default, end_stop, plausible, .. } = board.config(default_params(), 0);
        // Generic over the node: the name goes on with what it was made for.
        let tick = image.symbols.all().iter().find(|symbol| symbol.name.starts_with(TICK));
        let queue = image.variables.all().iter().find(|symbol| symbol.name.ends_with(QUEUE));
        Ok(Twin {
            id,
            node: node::by_id(id, NodeConfig { default, boot_nonce: 0, end_stop, plausible }),
            entry: named(TICK, tick.map(|symbol| symbol.address))?,
            scan: named(SCAN, image.variables.address(SCAN))?,
            // The counters come first: sent, then taken.
            taken_at: named(QUEUE, queue.map(|symbol| symbol.address))? + 4,
            taken: 0,
            ticks: 0,
            heard: VecDeque::new(),
            expected: VecDeque::new(),
            said: VecDeque::new(),
            commands: [Command::Brake; 2],
        })
    }

    /// What the tick before did.
    fn check_last(
        &mut self,
        chip: &Chip,
        commands: [Command; 2],
        compared: &mut Compared,
        tap: &mut Socket,
    ) -> Result<(), String> {
        let (at_us, station) = (chip.now().0 / 48, Station::Node(self.id));
        let taken = chip.peek(self.taken_at, Width::Word).unwrap_or_default();
        if taken != self.taken {
            if taken != self.taken.wrapping_add(1) {
                return Err(format!("{} messages taken in one tick", taken.wrapping_sub(self.taken)));
            }
            self.taken = taken;
            let message = self.heard.pop_front().ok_or("took a message that no frame brought")?;
            if tap.connected() {
                tap.pass(at_us, station, Passing::Frame(&message.encode()));
            }
            self.expected.extend(self.node.on_message(&message));
        }
        if self.ticks > 0 {
            tap.pass(at_us, station, Passing::Commands(commands));
            for (side, (chip, library)) in ["left", "right"].into_iter().zip(commands.into_iter().zip(self.commands)) {
                compared.commands += 1;
                if chip != library {
                    return Err(format!("the {side} actuator is told {chip:?}, by the library {library:?}"));
                }
            }
        }
        while let Some(said) = self.said.pop_front() {
            compared.frames += 1;
            if tap.connected() {
                tap.pass(at_us, station, Passing::Sent(&said.encode()));
            }
            let said = without_nonce(said);
            match self.expected.pop_front() {
                Some(expected) if expected == said => {}
                Some(expected) => return Err(format!("sent {said:?}, the library {expected:?}")),
                None => return Err(format!("sent {said:?}, the library nothing")),
            }
        }
        Ok(())
    }

    fn tick(&mut self, chip: &Chip, tap: &mut Socket) {
        self.ticks += 1;
        let count = |index: u32| chip.peek(self.scan + 2 * index, Width::Half).unwrap_or_default() as u16;
        let counts = Counts { position: [0, 1].map(count), load: [2, 3, 4, 5].map(count) };
        // The first argument.
        let dt_us = chip.cpu().registers().r[0];
        tap.pass(chip.now().0 / 48, Station::Node(self.id), Passing::Tick { dt_us, counts: &counts });
        let calibration = calibration_of(self.id);
        let out = self.node.tick(dt_us, &calibration.sensors(&counts));
        self.commands = out.drive.map(|drive| calibration.command(drive));
        self.expected.extend(out.messages);
    }
}

fn without_nonce(message: Message) -> Message {
    match message {
        Message::Status(node, status) => Message::Status(node, sarah_protocol::bus::Status { boot_nonce: 0, ..status }),
        other => other,
    }
}
