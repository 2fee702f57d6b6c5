//! Images on one bus: `cargo run --release -p samc21 --example four_chips -- [options] <coordinator> <node> …`.
//!
//! The first image gets the IMU and the host link; inputs of the others are at mid-scale. Prints what crossed the bus, what
//! came out of the host link, and every violation. Options: `--millis N`; `--jam N` destroys every frame of the last but
//! one N ms, `--unplug N` takes the first image off the bus for as long.

use std::collections::BTreeMap;
use std::ops::Range;
use std::time::Instant;

use samc21::pins::{PA, PB};
use samc21::wires::{Serial, SpiLink, Uart};
use samc21::{CanBus, Chip, Cycles, Exchange, Image, ImuDevice, Machine};

/// Supply of the boards, V.
const SUPPLY: f32 = 3.3;
/// Pins that the board pulls down: pulses and brakes.
const PULLED_DOWN: [(usize, u8); 4] = [(PA, 20), (PA, 21), (PB, 30), (PB, 31)];

/// The bus, and a sensor whose values move as those of a real one do.
struct World {
    bus: CanBus,
    round: i16,
    /// When the bus is jammed, and when the first station is unplugged.
    jam: Range<Cycles>,
    unplug: Range<Cycles>,
}

impl Exchange for World {
    fn exchange(&mut self, now: Cycles, chips: &mut [Chip]) {
        self.bus.jam(self.jam.contains(&now));
        match self.unplug.contains(&now) {
            true => self.bus.unplug(0),
            false => self.bus.plug(0),
        }
        self.bus.exchange(now, chips);
        // Once a millisecond.
        if now.0.is_multiple_of(48_000)
            && let Some(chip) = chips.first_mut()
            && let Serial::Spi(link) = &mut chip.wires_mut().serial[1]
            && let Some(sensor) = link.device_mut::<ImuDevice>()
        {
            self.round = (self.round + 1) % 50;
            sensor.set([self.round, -self.round, 2048], [self.round; 3]);
        }
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (mut millis, mut jam, mut unplug, mut paths) = (1000_u64, 0, 0, vec![]);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--millis" => millis = arguments.next().ok_or("--millis needs a number")?.parse()?,
            "--jam" => jam = arguments.next().ok_or("--jam needs a number")?.parse()?,
            "--unplug" => unplug = arguments.next().ok_or("--unplug needs a number")?.parse()?,
            _ => paths.push(argument),
        }
    }
    let mut chips = vec![];
    for (index, path) in paths.iter().enumerate() {
        let mut chip = Chip::new(&Image::from_elf(&std::fs::read(path)?)?);
        let wires = chip.wires_mut();
        wires.supply = SUPPLY;
        wires.analog = [[SUPPLY / 2.0; 12]; 2];
        for (group, pin) in PULLED_DOWN {
            wires.pins[group].solder(pin, false);
        }
        if index == 0 {
            wires.serial[1] = Serial::Spi(SpiLink::new(ImuDevice::default(), (PA, 17)));
            wires.serial[4] = Serial::Uart(Uart::default());
        }
        chips.push(chip);
    }
    let last_but_one = |length: u64| {
        let end = millis.saturating_sub(length);
        Cycles::from_millis(end.saturating_sub(length))..Cycles::from_millis(end)
    };
    let bus = CanBus::of_chips(chips.len());
    let mut world = World { bus, round: 0, jam: last_but_one(jam), unplug: last_but_one(unplug) };
    world.bus.record(true);
    let mut machine = Machine::new(chips);
    let start = Instant::now();
    machine.run_until(Cycles::from_millis(millis), &mut world);
    let seconds = start.elapsed().as_secs_f64();
    println!("{millis} ms emulated in {seconds:.2} s");

    let mut sent: BTreeMap<(usize, u32, u8, String), (u32, u64)> = BTreeMap::new();
    for record in world.bus.take_log() {
        let outcome = record.error.map_or("sent".into(), |error| format!("{error:?}"));
        let entry = sent.entry((record.sender, record.frame.id, record.frame.length, outcome)).or_default();
        *entry = (entry.0 + 1, record.end - record.start);
    }
    for ((sender, id, length, outcome), (count, ticks)) in sent {
        println!(
            "{:>12} {id:#05x} [{length:>2}] {outcome:>12} {count:>6} × {:.0} µs",
            name(&paths[sender]),
            ticks as f64 / 48.0
        );
    }
    for (chip, path) in machine.chips.iter().zip(&paths) {
        let place = chip.context().symbols.describe(chip.cpu().registers().r[15]).unwrap_or_default();
        println!("── {}: awake {:.1} %, at {place}", name(path), 100.0 * chip.awake() as f64 / chip.now().0 as f64);
        if let Serial::Uart(uart) = &chip.wires().serial[4] {
            let first: Vec<String> = uart.from_chip.iter().take(40).map(|byte| format!("{:02x}", byte.byte)).collect();
            println!("host link: {} bytes: {} …", uart.from_chip.len(), first.join(" "));
        }
        let mut kinds: BTreeMap<String, (usize, String)> = BTreeMap::new();
        for violation in chip.violations() {
            let key = format!("{:?} {:?} {:?}", violation.kind, violation.unit, violation.symbol);
            kinds.entry(key).or_insert((0, violation.to_string())).0 += 1;
        }
        for (count, example) in kinds.values() {
            println!("{count:>5} × {example}");
        }
    }
    Ok(())
}

fn name(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or(path)
}
