//! The image of the hip node: LPG2.
#![no_std]
#![no_main]

use sarah_firmware::board::samc21::node::{Board, Bus, Control, Place, ToNode};
use sarah_firmware::board::samc21::queue::Queue;
use sarah_firmware::board::samc21::vectors::interrupt;
use sarah_firmware::board::samc21::wiring::{self, NodeBoard};
use sarah_firmware::node::{SwingEar, SwingNode};

/// This image.
enum Hip {}

impl Place for Hip {
    const BOARD: NodeBoard = wiring::HIP;
    type Ear = SwingEar;
    type Node = SwingNode;
}

static TO_NODE: ToNode<Hip> = ToNode::<Hip>::new(Queue::new());
static CONTROL: Control<Hip> = Control::new();

#[cortex_m_rt::interrupt]
fn AC() {
    // SAFETY: this is that handler.
    unsafe { CONTROL.on_interrupt() }
}

#[embassy_executor::task]
async fn bus(bus: Bus<Hip>) -> ! {
    bus.serve().await
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let board = Board::start(&TO_NODE, |_| SwingEar::HIP);
    let config = board.config(sarah_firmware::default_params());
    let node = SwingNode::new(config, board.ear());
    board.run(node, &CONTROL, |ends| bus(ends).expect("it is spawned once"))
}
