//! CAN controllers of several chips on the shared bus, driven through their registers.

#[path = "support/bench.rs"]
mod bench;

use bench::connect;
use samc21::can_bus::{CanBus, Station};
use samc21::pins::Function;
use samc21::wires::CanError;
use samc21::{Chip, Cycles, Kind, Machine, Width};

const CAN0: u32 = 0x4200_1c00;
const CCCR: u32 = 0x18;
const NBTP: u32 = 0x1c;
const DBTP: u32 = 0x0c;
const ECR: u32 = 0x40;
const PSR: u32 = 0x44;
const TDCR: u32 = 0x48;
const IR: u32 = 0x50;
const GFC: u32 = 0x80;
const SIDFC: u32 = 0x84;
const RXF0C: u32 = 0xa0;
const RXF0S: u32 = 0xa4;
const RXF0A: u32 = 0xa8;
const RXESC: u32 = 0xbc;
const TXBC: u32 = 0xc0;
const TXFQS: u32 = 0xc4;
const TXESC: u32 = 0xc8;
const TXBRP: u32 = 0xcc;
const TXBAR: u32 = 0xd0;
const TXBCR: u32 = 0xd4;
const TXBTO: u32 = 0xd8;
const TXBCF: u32 = 0xdc;

const FILTERS: u32 = 0x100;
const RX: u32 = 0x1000;
const TX: u32 = 0x2000;
const SRAM: u32 = 0x2000_0000;
const ELEMENT: u32 = 72;

/// 1 Mbit/s at 79 %, 2 Mbit/s at 75 % with 48 MHz.
const NOMINAL: u32 = 36 << 8 | 9 | 9 << 25;
const FAST: u32 = 16 << 8 | 5 << 4 | 5 | 1 << 23;

/// A chip with clocks and pins for both controllers.
fn chip() -> Chip {
    let mut chip = bench::chip(&[26, 27]);
    for (group, pin) in [(0, 24), (0, 25), (1, 14), (1, 15)] {
        connect(&mut chip, group, pin, Function::G);
    }
    chip
}

fn set(chip: &mut Chip, register: u32, value: u32) {
    chip.bus_write(CAN0 + register, Width::Word, value);
}

fn get(chip: &mut Chip, register: u32) -> u32 {
    chip.bus_read(CAN0 + register, Width::Word)
}

fn configure(chip: &mut Chip, nominal: u32, fast: u32) {
    set(chip, CCCR, 1);
    set(chip, CCCR, 3);
    set(chip, CCCR, 3 | 1 << 8 | 1 << 9);
    set(chip, NBTP, nominal);
    set(chip, DBTP, fast);
    set(chip, TDCR, 18 << 8);
    // Nothing but what the filters let in.
    set(chip, GFC, 0x3f);
    set(chip, SIDFC, FILTERS | 1 << 16);
    chip.bus_write(SRAM + FILTERS, Width::Word, 1 << 27 | 0x7ff);
    set(chip, RXF0C, RX | 4 << 16);
    set(chip, RXESC, 7);
    set(chip, TXBC, TX | 4 << 24);
    set(chip, TXESC, 7);
}

fn go(chip: &mut Chip) {
    let control = get(chip, CCCR);
    set(chip, CCCR, control & !1);
}

/// Puts a 64-byte FD frame into the FIFO.
fn send(chip: &mut Chip, id: u32, fill: u8) {
    let put = get(chip, TXFQS) >> 16 & 31;
    let base = SRAM + TX + put * ELEMENT;
    chip.bus_write(base, Width::Word, id << 18);
    chip.bus_write(base + 4, Width::Word, 1 << 21 | 1 << 20 | 15 << 16);
    for word in 0..16 {
        chip.bus_write(base + 8 + 4 * word, Width::Word, u32::from_le_bytes([fill, word as u8, fill, 0]));
    }
    set(chip, TXBAR, 1 << put);
}

/// Identifier and bytes of the oldest frame in FIFO 0.
fn receive(chip: &mut Chip) -> Option<(u32, [u8; 64])> {
    let status = get(chip, RXF0S);
    if status & 0x7f == 0 {
        return None;
    }
    let index = status >> 8 & 0x3f;
    let base = SRAM + RX + index * ELEMENT;
    let id = chip.bus_read(base, Width::Word) >> 18 & 0x7ff;
    let mut data = [0; 64];
    for (word, bytes) in data.chunks_mut(4).enumerate() {
        bytes.copy_from_slice(&chip.bus_read(base + 8 + 4 * word as u32, Width::Word).to_le_bytes());
    }
    set(chip, RXF0A, index);
    Some((id, data))
}

struct Rig {
    machine: Machine,
    bus: CanBus,
}

impl Rig {
    fn new(timings: &[(u32, u32)]) -> Rig {
        let mut chips = vec![];
        for (nominal, fast) in timings {
            let mut chip = chip();
            configure(&mut chip, *nominal, *fast);
            go(&mut chip);
            chips.push(chip);
        }
        let mut bus = CanBus::of_chips(chips.len());
        bus.record(true);
        let mut rig = Rig { machine: Machine::new(chips), bus };
        // The chips have spent a millisecond on their clocks.
        rig.run(1200);
        rig
    }

    fn run(&mut self, micros: u64) {
        let until = self.machine.now() + Cycles::from_micros(micros).0;
        assert_eq!(self.machine.run_until(until, &mut self.bus), None);
    }

    fn chip(&mut self, index: usize) -> &mut Chip {
        &mut self.machine.chips[index]
    }

    fn counters(&mut self, index: usize) -> (u32, u32) {
        let counters = get(self.chip(index), ECR);
        (counters & 0xff, counters >> 8 & 0x7f)
    }

    fn assert_clean(&self) {
        for chip in &self.machine.chips {
            assert!(chip.violations().is_empty(), "{:#?}", chip.violations());
        }
    }
}

const GOOD: (u32, u32) = (NOMINAL, FAST);

#[test]
fn two_chips_exchange_frames_of_64_bytes() {
    let mut rig = Rig::new(&[GOOD, GOOD]);
    send(rig.chip(0), 0x123, 0xa5);
    send(rig.chip(1), 0x124, 0x5a);
    rig.run(1000);
    let (id, data) = receive(rig.chip(1)).expect("a frame");
    assert_eq!((id, data[0], data[61], data[62]), (0x123, 0xa5, 15, 0xa5));
    let (id, data) = receive(rig.chip(0)).expect("a frame");
    assert_eq!((id, data[0], data[61]), (0x124, 0x5a, 15));
    assert_eq!(receive(rig.chip(0)), None);
    assert_eq!(rig.counters(0), (0, 0));
    assert_eq!(get(rig.chip(0), TXBTO), 1);
    // Sent and received without error, FD with bit rate switch; the delay was measured.
    let status = get(rig.chip(0), PSR);
    assert_eq!((status & 7, status >> 12 & 3, status >> 16), (0, 3, 18 + 6));
    rig.assert_clean();
    let log = rig.bus.take_log();
    assert_eq!(log.iter().map(|record| record.frame.id).collect::<Vec<_>>(), [0x123, 0x124]);
    // 27 to 30 slow bits and some 560 fast ones.
    let micros = (log[0].end - log[0].start) / 48;
    assert!((300..330).contains(&micros), "{micros} µs");
    assert!(log[1].start - log[0].end >= 3 * 48);
}

#[test]
fn of_frames_offered_together_the_lowest_identifier_goes_first() {
    let mut rig = Rig::new(&[GOOD, GOOD, GOOD]);
    for (chip, id) in [(0, 0x300), (1, 0x100), (2, 0x200)] {
        send(rig.chip(chip), id, 0);
    }
    rig.run(2000);
    let order: Vec<u32> = rig.bus.take_log().iter().map(|record| record.frame.id).collect();
    assert_eq!(order, [0x100, 0x200, 0x300]);
    rig.assert_clean();
}

#[test]
fn a_fifo_keeps_its_order_and_loses_nothing_in_blocking_mode() {
    let mut rig = Rig::new(&[GOOD, GOOD]);
    for id in [5, 4, 3, 2] {
        send(rig.chip(0), id, 0);
    }
    assert_eq!(get(rig.chip(0), TXFQS) >> 21 & 1, 1, "full");
    rig.run(2000);
    assert_eq!(get(rig.chip(0), TXFQS) & 0x3f, 4, "free again");
    send(rig.chip(0), 1, 0);
    rig.run(1000);
    // The fifth found the FIFO full and was lost, with a flag.
    assert_eq!(get(rig.chip(1), IR) & 0xf, 0xd);
    let ids: Vec<u32> = std::iter::from_fn(|| receive(rig.chip(1))).map(|(id, _)| id).collect();
    assert_eq!(ids, [5, 4, 3, 2]);
    rig.assert_clean();
}

#[test]
fn filters_decide_what_is_kept_but_not_what_is_acknowledged() {
    let mut rig = Rig::new(&[GOOD, GOOD]);
    rig.chip(1).bus_write(SRAM + FILTERS, Width::Word, 1 << 27 | 0x100 << 16 | 0x1ff);
    for id in [0x0ff, 0x100, 0x1ff, 0x200] {
        send(rig.chip(0), id, 0);
    }
    rig.run(2000);
    let ids: Vec<u32> = std::iter::from_fn(|| receive(rig.chip(1))).map(|(id, _)| id).collect();
    assert_eq!(ids, [0x100, 0x1ff]);
    assert_eq!(get(rig.chip(0), TXBTO), 0xf);
}

#[test]
fn alone_on_the_wire_a_sender_turns_passive_and_goes_on_when_plugged_in() {
    let mut rig = Rig::new(&[GOOD, GOOD]);
    rig.bus.unplug(0);
    send(rig.chip(0), 0x10, 1);
    rig.run(20_000);
    assert_eq!(rig.counters(0), (128, 0));
    assert_eq!(get(rig.chip(0), PSR) & 7, CanError::Acknowledge as u32);
    assert_eq!(get(rig.chip(0), CCCR) & 1, 0, "not bus-off");
    rig.bus.plug(0);
    rig.run(1000);
    assert_eq!(receive(rig.chip(1)).map(|(id, _)| id), Some(0x10));
    // The attempt that plugging in cut off, and the one that succeeded.
    assert_eq!(rig.counters(0).0, 128 + 8 - 1);
}

#[test]
fn a_jammed_bus_ends_in_bus_off_and_recovery_takes_129_sequences() {
    let mut rig = Rig::new(&[GOOD, GOOD]);
    rig.bus.jam(true);
    send(rig.chip(0), 0x10, 1);
    rig.run(20_000);
    assert_eq!(get(rig.chip(0), CCCR) & 1, 1);
    assert_eq!(get(rig.chip(0), PSR) >> 7 & 1, 1);
    assert_ne!(get(rig.chip(0), IR) & 1 << 25, 0);
    let attempts = rig.bus.take_log();
    assert_eq!(attempts.len(), 32);
    rig.bus.jam(false);
    go(rig.chip(0));
    let start = rig.machine.now();
    while get(rig.chip(0), PSR) >> 7 & 1 == 1 {
        rig.run(10);
    }
    let bits = (rig.machine.now() - start) / 48;
    assert!((129 * 11..129 * 11 + 40).contains(&bits), "{bits}");
    rig.run(1000);
    assert_eq!(receive(rig.chip(1)).map(|(id, _)| id), Some(0x10), "what was pending goes out");
    rig.assert_clean();
}

#[test]
fn a_spoiled_frame_is_repeated_and_counted() {
    let mut rig = Rig::new(&[GOOD, GOOD]);
    rig.bus.corrupt_next(1);
    send(rig.chip(0), 0x10, 1);
    rig.run(1000);
    assert_eq!(receive(rig.chip(1)).map(|(id, _)| id), Some(0x10));
    assert_eq!(rig.counters(0), (7, 0));
    assert_eq!(rig.counters(1), (0, 0));
    let errors: Vec<_> = rig.bus.take_log().iter().map(|record| record.error).collect();
    assert_eq!(errors, [Some(CanError::Bit0), None]);
}

#[test]
fn noise_spoils_the_same_frames_for_the_same_seed() {
    let run = |seed| {
        let mut rig = Rig::new(&[GOOD, GOOD]);
        rig.bus.set_noise(300_000, seed);
        for round in 0..10 {
            send(rig.chip(0), 0x10 + round, 1);
            rig.run(1500);
        }
        rig.bus.take_log()
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[test]
fn a_snapshot_taken_in_mid_frame_continues_as_the_original() {
    let mut rig = Rig::new(&[GOOD, GOOD]);
    rig.bus.set_noise(300_000, 7);
    for id in 1..=4 {
        send(rig.chip(0), id, 3);
    }
    rig.run(150);
    let mut copy = Rig { machine: rig.machine.clone(), bus: rig.bus.clone() };
    let end = |rig: &mut Rig| {
        rig.run(5000);
        let received: Vec<_> = std::iter::from_fn(|| receive(rig.chip(1))).collect();
        (received, rig.bus.take_log())
    };
    assert_eq!(end(&mut rig), end(&mut copy));
}

#[test]
fn a_station_with_another_bit_rate_destroys_every_frame_until_it_is_passive() {
    let slow = (NOMINAL | 1 << 16, FAST);
    let mut rig = Rig::new(&[GOOD, GOOD, slow]);
    send(rig.chip(0), 0x10, 1);
    rig.run(30_000);
    assert!(rig.bus.take_log().iter().any(|record| record.error == Some(CanError::Bit1)));
    assert_ne!(get(rig.chip(2), PSR) & 1 << 5, 0, "error passive");
}

#[test]
fn a_request_can_be_cancelled_until_it_is_on_the_wire() {
    let mut rig = Rig::new(&[GOOD, GOOD]);
    send(rig.chip(0), 0x10, 1);
    send(rig.chip(0), 0x11, 1);
    rig.run(50);
    set(rig.chip(0), TXBCR, 3);
    assert_eq!((get(rig.chip(0), TXBRP), get(rig.chip(0), TXBCF)), (1, 2));
    rig.run(1000);
    assert_eq!((get(rig.chip(0), TXBTO), get(rig.chip(0), TXBCF)), (1, 3));
    assert_eq!(std::iter::from_fn(|| receive(rig.chip(1))).count(), 1);
}

#[test]
fn a_sender_reset_in_mid_frame_leaves_a_broken_frame() {
    let mut rig = Rig::new(&[GOOD, GOOD]);
    send(rig.chip(0), 0x10, 1);
    rig.run(100);
    rig.chip(0).reset(samc21::Reset::External);
    rig.run(1000);
    assert_eq!(receive(rig.chip(1)), None);
    assert_eq!(rig.counters(1), (0, 1));
}

#[test]
fn configuration_is_protected_outside_init() {
    let mut rig = Rig::new(&[GOOD]);
    set(rig.chip(0), NBTP, 0x0600_0a03);
    assert_eq!(get(rig.chip(0), NBTP), NOMINAL);
    assert_eq!(rig.chip(0).violations()[0].kind, Kind::EnableProtected);
    // Writing what is there changes nothing and is no fault.
    set(rig.chip(0), NBTP, NOMINAL);
    assert_eq!(rig.chip(0).violations().len(), 1);
}

#[test]
fn init_reads_back_only_after_it_has_crossed_the_clock_domains() {
    let mut chip = chip();
    configure(&mut chip, NOMINAL, FAST);
    go(&mut chip);
    assert_eq!(get(&mut chip, CCCR) & 1, 1);
    // A read-modify-write now would take the request back.
    let control = get(&mut chip, CCCR);
    set(&mut chip, CCCR, control);
    assert_eq!(chip.violations()[0].kind, Kind::SyncBusy);
    let now = chip.now();
    chip.run_until(now + 100);
    assert_eq!(get(&mut chip, CCCR) & 3, 0);
}

#[test]
fn message_ram_beyond_the_sram_is_reported() {
    let mut rig = Rig::new(&[GOOD, GOOD]);
    let control = get(rig.chip(1), CCCR);
    set(rig.chip(1), CCCR, control | 1);
    rig.run(10);
    set(rig.chip(1), CCCR, control | 3);
    set(rig.chip(1), RXF0C, 0x9000 | 4 << 16);
    go(rig.chip(1));
    rig.run(100);
    send(rig.chip(0), 0x10, 1);
    rig.run(1000);
    let kinds: Vec<Kind> = rig.chip(1).violations().iter().map(|violation| violation.kind).collect();
    assert!(kinds.contains(&Kind::Misuse("CAN message RAM outside the SRAM")), "{kinds:?}");
}

#[test]
fn without_its_clock_the_controller_never_leaves_init() {
    let mut chip = bench::chip(&[]);
    configure(&mut chip, NOMINAL, FAST);
    go(&mut chip);
    let now = chip.now();
    chip.run_until(now + 10_000);
    assert_eq!(get(&mut chip, CCCR) & 1, 1);
    assert_eq!(chip.violations()[0].kind, Kind::Unclocked);
}

#[test]
fn both_controllers_of_a_chip_can_be_stations() {
    let bus = CanBus::new([Station { chip: 0, port: 0 }, Station { chip: 0, port: 1 }]);
    let mut chip = chip();
    configure(&mut chip, NOMINAL, FAST);
    go(&mut chip);
    let mut rig = Rig { machine: Machine::new(vec![chip]), bus };
    rig.run(1200);
    // CAN1 acknowledges with its reset timing set to the same rates.
    let can1 = 0x400;
    for (register, value) in [(CCCR, 1), (CCCR, 3), (CCCR, 0x303), (NBTP, NOMINAL), (DBTP, FAST), (GFC, 0x3f)] {
        set(rig.chip(0), can1 + register, value);
    }
    set(rig.chip(0), can1 + CCCR, 0x302);
    rig.run(100);
    send(rig.chip(0), 0x10, 1);
    rig.run(1000);
    assert_eq!(get(rig.chip(0), TXBTO), 1);
    rig.assert_clean();
}
