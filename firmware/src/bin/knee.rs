//! The image of the knee node: LPG1.
#![no_std]
#![no_main]

use sarah_firmware::board::samc21::divider::Divas;
use sarah_firmware::board::samc21::node::{Board, Control};
use sarah_firmware::board::samc21::vectors::interrupt;
use sarah_firmware::board::samc21::wiring;
use sarah_firmware::lpg::rules;
use sarah_firmware::node::KneeNode;

static CONTROL: Control<KneeNode<Divas>> = Control::new();

#[cortex_m_rt::interrupt]
fn AC() {
    CONTROL.on_interrupt();
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let mut board = Board::start(&wiring::KNEE);
    let config = board.config(sarah_firmware::default_params());
    let node = KneeNode::new(config, rules::KNEE, board.divider());
    board.run(node, &CONTROL)
}
