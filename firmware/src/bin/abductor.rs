//! The image of the abductor node: LPG3.
#![no_std]
#![no_main]

use sarah_firmware::board::samc21::node::{Board, Bus, Control, Place, ToNode};
use sarah_firmware::board::samc21::queue::Queue;
use sarah_firmware::board::samc21::vectors::interrupt;
use sarah_firmware::board::samc21::wiring::{self, NodeBoard};
use sarah_firmware::node::{SwingEar, SwingNode};

/// This image.
enum Abductor {}

impl Place for Abductor {
    const BOARD: NodeBoard = wiring::ABDUCTOR;
    type Ear = SwingEar;
    type Node = SwingNode;
}

static TO_NODE: ToNode<Abductor> = ToNode::<Abductor>::new(Queue::new());
static CONTROL: Control<Abductor> = Control::new();

#[cortex_m_rt::interrupt]
fn AC() {
    // SAFETY: this is that handler.
    unsafe { CONTROL.on_interrupt() }
}

#[embassy_executor::task]
async fn bus(bus: Bus<Abductor>) -> ! {
    bus.serve().await
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let board = Board::start(&TO_NODE, |_| SwingEar::ABDUCTOR);
    let config = board.config(sarah_firmware::default_params());
    let node = SwingNode::new(config, board.ear());
    board.run(node, &CONTROL, |ends| bus(ends).expect("it is spawned once"))
}
