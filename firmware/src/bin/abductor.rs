//! The image of the abductor node: LPG3.
#![no_std]
#![no_main]

use sarah_firmware::board::samc21::node::{Board, Control};
use sarah_firmware::board::samc21::vectors::interrupt;
use sarah_firmware::board::samc21::wiring;
use sarah_firmware::lpg::rules;
use sarah_firmware::node::SwingNode;

static CONTROL: Control<SwingNode> = Control::new();

#[cortex_m_rt::interrupt]
fn AC() {
    CONTROL.on_interrupt();
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let board = Board::start(&wiring::ABDUCTOR);
    let config = board.config(sarah_firmware::default_params());
    let node = SwingNode::new(wiring::ABDUCTOR.id, config, rules::ABDUCTOR);
    board.run(node, &CONTROL)
}
