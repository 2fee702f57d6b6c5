//! The image of the knee node: LPG1.
#![no_std]
#![no_main]

use sarah_firmware::board::samc21::divider::Divas;
use sarah_firmware::board::samc21::node::{Board, Bus, Control, Place, ToNode};
use sarah_firmware::board::samc21::queue::Queue;
use sarah_firmware::board::samc21::vectors::interrupt;
use sarah_firmware::board::samc21::wiring::{self, NodeBoard};
use sarah_firmware::node::{KneeEar, KneeNode};

/// This image.
enum Knee {}

impl Place for Knee {
    const BOARD: NodeBoard = wiring::KNEE;
    type Ear = KneeEar<Divas>;
    type Node = KneeNode;
}

static TO_NODE: ToNode<Knee> = ToNode::<Knee>::new(Queue::new());
static CONTROL: Control<Knee> = Control::new();

#[cortex_m_rt::interrupt]
fn AC() {
    // SAFETY: this is that handler.
    unsafe { CONTROL.on_interrupt() }
}

#[embassy_executor::task]
async fn bus(bus: Bus<Knee>) -> ! {
    bus.serve().await
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let board = Board::start(&TO_NODE, KneeEar::new);
    let config = board.config(sarah_firmware::default_params());
    let node = KneeNode::new(config, board.ear());
    board.run(node, &CONTROL, |ends| bus(ends).expect("it is spawned once"))
}
