//! What the registers of one controller do with frames, without a bus.

use super::*;
use crate::clocks::Hertz;
use crate::pins::Function;
use crate::wires::CanFrame;

const FILTERS: u32 = 0x100;
const EXTENDED: u32 = 0x200;
const RX0: u32 = 0x400;
const RX1: u32 = 0x800;
const BUFFERS: u32 = 0xc00;
const TX: u32 = 0x1000;
const EVENTS: u32 = 0x1800;
const SRAM: u32 = 0x2000_0000;

struct Bench {
    can: Can,
    ctx: Context,
}

impl Bench {
    /// Joined, with elements of 8 bytes: two in FIFO 0, three in FIFO 1.
    fn new(settings: &[(u32, u32)]) -> Bench {
        let mut ctx = Context::default();
        ctx.clocks.generic[CLOCK] = Some(Hertz(48_000_000));
        for pin in [24, 25] {
            ctx.wires.pins[0].function[pin] = Some(Function::G);
        }
        let mut bench = Bench { can: Can::new(0), ctx };
        bench.set(CCCR, 3);
        bench.set(CCCR, 3 | CCCR_FDOE | CCCR_BRSE);
        for (register, value) in [
            (GFC, 0x3f),
            (SIDFC, FILTERS | 8 << 16),
            (XIDFC, EXTENDED | 4 << 16),
            (RXF0C, RX0 | 2 << 16),
            (RXF1C, RX1 | 3 << 16 | 2 << 24),
            (RXBC, BUFFERS),
            (TXBC, TX | 2 << 16 | 2 << 24),
            (TXEFC, EVENTS | 2 << 16),
        ] {
            bench.set(register, value);
        }
        for (register, value) in settings {
            bench.set(*register, *value);
        }
        let control = bench.get(CCCR);
        bench.set(CCCR, control & !CCCR_INIT);
        bench.wait();
        bench.ctx.wires.can[0].joining = 0;
        bench.event(CanEvent::Joined);
        assert_eq!(bench.ctx.violations(), []);
        bench
    }

    fn set(&mut self, register: u32, value: u32) {
        self.can.write(register, Width::Word, value, &mut self.ctx);
    }

    fn get(&mut self, register: u32) -> u32 {
        self.can.read(register, Width::Word, &mut self.ctx)
    }

    fn wait(&mut self) {
        self.ctx.now += 100;
        self.can.advance(&mut self.ctx);
    }

    fn event(&mut self, event: CanEvent) {
        let now = self.ctx.now;
        self.ctx.wires.can[0].events.push_back((now, event));
        self.can.notice(&mut self.ctx);
        self.can.advance(&mut self.ctx);
    }

    fn poke(&mut self, offset: u32, value: u32) {
        self.ctx.sram.write(SRAM + offset, Width::Word, value);
    }

    fn peek(&self, offset: u32) -> u32 {
        self.ctx.sram.read(SRAM + offset, Width::Word)
    }

    fn arrives(&mut self, id: u32, extended: bool) {
        let mut frame = frame(id);
        frame.extended = extended;
        self.event(CanEvent::Received(frame));
    }

    /// The identifiers in FIFO `fifo`, taken out.
    fn drain(&mut self, fifo: u32) -> Vec<u32> {
        let (status, acknowledge, base) = [(RXF0S, RXF0A, RX0), (RXF1S, RXF1A, RX1)][fifo as usize];
        let mut ids = vec![];
        while self.get(status) & 0x7f != 0 {
            let index = self.get(status) >> 8 & 0x3f;
            let first = self.peek(base + 16 * index);
            ids.push(if first >> 30 & 1 != 0 { first & 0x1fff_ffff } else { first >> 18 & 0x7ff });
            self.set(acknowledge, index);
        }
        ids
    }

    fn offered(&self) -> Option<u32> {
        self.ctx.wires.can[0].offered.map(|(_, frame)| frame.id)
    }

    /// Puts a classic frame with an event into buffer `index` and requests it.
    fn request(&mut self, index: u32, id: u32) {
        self.poke(TX + 16 * index, id << 18);
        self.poke(TX + 16 * index + 4, 1 << 16 | 1 << 23 | id << 24);
        self.set(TXBAR, 1 << index);
    }
}

fn frame(id: u32) -> CanFrame {
    CanFrame {
        id,
        extended: false,
        fd: false,
        bit_rate_switch: false,
        error_state: false,
        remote: false,
        length: 2,
        data: [7; 64],
    }
}

#[test]
fn the_first_standard_filter_that_matches_decides() {
    let mut bench = Bench::new(&[]);
    let element = |kind: u32, code: u32, one: u32, two: u32| kind << 30 | code << 27 | one << 16 | two;
    for (index, filter) in [
        element(1, 3, 0x101, 0x102), // these two: reject
        element(0, 1, 0x100, 0x10f), // range: FIFO 0
        element(2, 2, 0x200, 0x7f0), // id and mask: FIFO 1
        element(3, 1, 0x300, 0x300), // disabled
        element(0, 7, 0x400, 5),     // buffer 5
        element(0, 6, 0x500, 0x500), // FIFO 1, high priority
    ]
    .into_iter()
    .enumerate()
    {
        bench.poke(FILTERS + 4 * index as u32, filter);
    }
    for id in [0x101, 0x102, 0x103, 0x20f, 0x210, 0x300, 0x400, 0x500] {
        bench.arrives(id, false);
    }
    assert_eq!(bench.drain(0), [0x103]);
    assert_eq!(bench.drain(1), [0x20f, 0x500]);
    assert_eq!(bench.get(NDAT1), 1 << 5);
    assert_eq!(bench.peek(BUFFERS + 5 * 16) >> 18, 0x400);
    // Filter 5, FIFO 1, its second element.
    assert_eq!(bench.get(HPMS), 5 << 8 | 3 << 6 | 1);
    assert_ne!(bench.get(IR) & flag::HPM, 0);
    // The element says which filter and how long.
    assert_eq!(bench.peek(RX0 + 4), 1 << 24 | 2 << 16);
}

#[test]
fn extended_filters_see_the_identifier_through_the_mask() {
    let mut bench = Bench::new(&[(XIDAM, 0x1fff_ff00)]);
    // Range through the mask, then the same range without it.
    for (offset, word) in [(0, 1 << 29 | 0x1_0000), (4, 0x1_00ff), (8, 2 << 29 | 0x2_0001), (12, 3 << 30 | 0x2_0002)] {
        bench.poke(EXTENDED + offset, word);
    }
    for id in [0x1_00aa, 0x1_0100, 0x2_0000, 0x2_0001] {
        bench.arrives(id, true);
    }
    assert_eq!(bench.drain(0), [0x1_00aa]);
    assert_eq!(bench.drain(1), [0x2_0001]);
}

#[test]
fn what_no_filter_matches_goes_where_gfc_says() {
    let mut bench = Bench::new(&[(GFC, 1 << 4 | 1 << 1)]);
    bench.arrives(0x123, false);
    let remote = CanFrame { remote: true, ..frame(0x124) };
    bench.event(CanEvent::Received(remote));
    assert_eq!(bench.drain(1), [0x123]);
    assert_eq!(bench.peek(RX1 + 4) >> 31, 1, "marked as not matching");
}

#[test]
fn a_full_fifo_loses_the_new_frame_or_in_overwrite_mode_the_oldest() {
    let mut bench = Bench::new(&[(GFC, 0)]);
    for id in 1..=3 {
        bench.arrives(id, false);
    }
    assert_eq!(bench.get(RXF0S) >> 24, 3, "full, lost");
    assert_eq!(bench.get(IR) & 0xf, flag::RF0N | flag::RF0F | flag::RF0L);
    bench.set(IR, flag::RF0L);
    assert_eq!(bench.get(RXF0S) >> 24, 1, "the copy of the lost flag goes with it");
    assert_eq!(bench.drain(0), [1, 2]);

    let mut bench = Bench::new(&[(GFC, 0), (RXF0C, RX0 | 2 << 16 | 1 << 31)]);
    for id in 1..=3 {
        bench.arrives(id, false);
    }
    assert_eq!(bench.get(IR) & flag::RF0L, 0);
    assert_eq!(bench.drain(0), [2, 3]);
}

#[test]
fn the_watermark_is_flagged_when_it_is_reached() {
    let mut bench = Bench::new(&[(GFC, 1 << 4)]);
    bench.arrives(1, false);
    assert_eq!(bench.get(IR) >> 4 & 0xf, 1);
    bench.arrives(2, false);
    assert_eq!(bench.get(IR) >> 4 & 0xf, 3);
}

#[test]
fn a_buffer_with_an_unread_message_matches_nothing() {
    let mut bench = Bench::new(&[]);
    bench.poke(FILTERS, 7 << 27 | 0x400 << 16);
    bench.poke(FILTERS + 4, 1 << 27 | 0x400 << 16 | 0x400);
    bench.arrives(0x400, false);
    bench.arrives(0x400, false);
    assert_eq!(bench.get(RXF0S) & 0x7f, 1);
    bench.set(NDAT1, 1);
    bench.arrives(0x400, false);
    assert_eq!((bench.get(RXF0S) & 0x7f, bench.get(NDAT1)), (1, 1));
}

#[test]
fn dedicated_buffers_and_the_oldest_of_the_fifo_compete_by_identifier() {
    let mut bench = Bench::new(&[]);
    bench.request(2, 0x300);
    bench.request(3, 0x100);
    assert_eq!(bench.offered(), Some(0x300), "the FIFO keeps its order");
    bench.request(1, 0x200);
    assert_eq!(bench.offered(), Some(0x200));
    let mut order = vec![];
    while let Some(id) = bench.offered() {
        order.push(id);
        bench.event(CanEvent::Sent);
    }
    assert_eq!(order, [0x200, 0x300, 0x100]);
    assert_eq!((bench.get(TXBRP), bench.get(TXBTO)), (0, 0xe));
    assert_ne!(bench.get(IR) & flag::TFE, 0);
}

#[test]
fn a_queue_sends_by_identifier() {
    let mut bench = Bench::new(&[(TXBC, TX | 3 << 24 | 1 << 30)]);
    for (index, id) in [(0, 0x300), (1, 0x100)] {
        assert_eq!(bench.get(TXFQS) >> 16 & 31, index);
        bench.request(index, id);
    }
    assert_eq!(bench.offered(), Some(0x100));
    bench.event(CanEvent::Sent);
    assert_eq!(bench.get(TXFQS) >> 16 & 0x3f, 1, "the buffer just sent is free");
}

#[test]
fn sent_frames_leave_events_until_their_fifo_is_full() {
    let mut bench = Bench::new(&[]);
    for id in [0x10, 0x11, 0x12] {
        bench.request(0, id);
        bench.event(CanEvent::Sent);
    }
    assert_eq!(bench.get(TXEFS) & 0x3f, 2);
    assert_eq!(bench.get(TXEFS) >> 24, 3, "full, lost");
    assert_eq!((bench.peek(EVENTS) >> 18, bench.peek(EVENTS + 4) >> 22), (0x10, 0x10 << 2 | 1), "marker and type");
    bench.set(TXEFA, 1);
    assert_eq!(bench.get(TXEFS) & 0x3f, 0);
}

#[test]
fn without_automatic_retransmission_a_failed_frame_counts_as_cancelled() {
    let mut bench = Bench::new(&[(CCCR, 3 | CCCR_DAR)]);
    bench.request(0, 0x10);
    bench.event(CanEvent::ArbitrationLost);
    assert_eq!((bench.get(TXBRP), bench.get(TXBTO), bench.get(TXBCF)), (0, 0, 1));
}

#[test]
fn the_line_into_the_nvic_follows_flags_enables_and_lines() {
    let mut bench = Bench::new(&[(GFC, 0)]);
    bench.arrives(1, false);
    assert_eq!(bench.ctx.lines, 0);
    bench.set(IE, flag::RF0N);
    assert_eq!(bench.ctx.lines, 0, "line 0 is off");
    bench.set(ILE, 1);
    assert_eq!(bench.ctx.lines, Irq::Can0.bit());
    bench.set(ILS, flag::RF0N);
    assert_eq!(bench.ctx.lines, 0, "moved to line 1");
    bench.set(ILE, 2);
    assert_eq!(bench.ctx.lines, Irq::Can0.bit());
    bench.set(IR, flag::RF0N);
    assert_eq!(bench.ctx.lines, 0);
}

#[test]
fn misuse_of_fifos_is_reported() {
    let mut bench = Bench::new(&[]);
    bench.set(RXF0A, 0);
    bench.request(3, 0x10);
    bench.request(3, 0x10);
    bench.set(TXBAR, 1 << 9);
    let kinds: Vec<Kind> = bench.ctx.violations().iter().map(|violation| violation.kind).collect();
    assert_eq!(
        kinds,
        [
            Kind::Misuse("acknowledges a FIFO element that holds no message"),
            Kind::Misuse("requests a FIFO buffer that is not at the put index"),
            Kind::Misuse("requests a transmit buffer that is still pending"),
            Kind::Misuse("requests a transmit buffer that TXBC does not configure"),
        ]
    );
}

#[test]
fn time_stamps_count_nominal_bits() {
    let mut bench = Bench::new(&[(GFC, 0), (TSCC, 1), (NBTP, 36 << 8 | 9)]);
    bench.set(TSCV, 0);
    bench.ctx.now += 48 * 1000;
    bench.arrives(1, false);
    assert_eq!(bench.peek(RX0 + 4) & 0xffff, 1000);
    bench.ctx.now += 48 * 65_000;
    bench.can.advance(&mut bench.ctx);
    assert_ne!(bench.get(IR) & flag::TSW, 0, "wrapped");
}
