//! What a control tick costs on the chip: `cargo firmware`, then
//! `cargo run -p sarah-sim --example tick -- <ELF> [<ELF> …]`.
//!
//! Each node image runs alone on an emulated chip for a minute: motion messages at 1 kHz, for hips and abductors the
//! knee's flags, inputs that move. A tick is all that the chip is awake for in interrupts from the tick's interrupt until
//! it is back in thread mode: wake-up, scan, node, actuators, queues. What the chip is awake for from one tick to the next
//! has the bus task and housekeeping besides. An overrun is a tick that did not come.

use std::collections::BTreeMap;
use std::error::Error;

use samc21::pins::{PA, PB};
use samc21::wires::{CanEvent, CanFrame};
use samc21::{Chip, Cycles, Image};
use sarah_protocol::bus::{Gait, GaitEvent, Message, Mode, Motion, Side};
use sarah_protocol::fixed::Q16;

/// Supply of the board, V.
const SUPPLY: f32 = 3.3;
/// Pins that the board pulls down: pulses and brakes.
const PULLED_DOWN: [(usize, u8); 4] = [(PA, 20), (PA, 21), (PB, 30), (PB, 31)];
/// Inputs of ADC0, in the order of the scan: two positions, four pads.
const INPUTS: [usize; 6] = [2, 3, 8, 9, 10, 11];
/// Exception of TC4.
const TICK: u32 = 16 + 24;
/// A frame on the wire, 48 MHz ticks.
const FRAME: u64 = 9_000;
/// Between two motion messages: not quite ten ticks, so that they meet ticks at every phase.
const MOTION: u64 = 48_013;
const SECONDS: u64 = 60;
/// Between two ticks at 10 kHz.
const PERIOD: u64 = 4_800;

fn main() -> Result<(), Box<dyn Error>> {
    println!(
        "| image | ticks | overruns | mean | p99 | max | awake, tick to tick: mean | p99 | max |\n\
         |---|---:|---:|---:|---:|---:|---:|---:|---:|"
    );
    let mut details = String::new();
    for path in std::env::args().skip(1) {
        let name = path.rsplit('/').next().unwrap_or(&path);
        let Cost { ticks, awake, overruns, in_ticks, between } =
            measure(&Image::from_elf(&std::fs::read(&path)?)?, name != "knee")?;
        let count = ticks.len();
        println!("| {name} | {count} | {overruns} | {} | {} |", summary(ticks), summary(awake));
        for (what, functions) in [("in ticks", in_ticks), ("between ticks", between)] {
            details += &format!("\n{name}, cycles per tick by function, {what}:\n");
            let mut functions: Vec<_> = functions.into_iter().collect();
            functions.sort_by_key(|(_, cycles)| std::cmp::Reverse(*cycles));
            for (function, cycles) in functions.iter().take(12) {
                details += &format!("{:7.1} {function}\n", *cycles as f64 / count as f64);
            }
        }
    }
    print!("{details}");
    Ok(())
}

/// Mean, 99th percentile, maximum.
fn summary(mut cycles: Vec<u64>) -> String {
    cycles.sort_unstable();
    let (count, sum) = (cycles.len(), cycles.iter().sum::<u64>());
    format!("{} | {} | {}", sum / count as u64, cycles[count * 99 / 100], cycles[count - 1])
}

/// Cycles by function.
type Functions = BTreeMap<String, u64>;

/// What a minute costs, cycles.
#[derive(Default)]
struct Cost {
    /// Each tick.
    ticks: Vec<u64>,
    /// Awake from the end of each tick to the end of the next.
    awake: Vec<u64>,
    /// Ticks that did not come.
    overruns: u64,
    in_ticks: Functions,
    between: Functions,
}

fn measure(image: &Image, follows: bool) -> Result<Cost, Box<dyn Error>> {
    let mut chip = Chip::new(image);
    let wires = chip.wires_mut();
    wires.supply = SUPPLY;
    wires.analog = [[SUPPLY / 2.0; 12]; 2];
    for (group, pin) in PULLED_DOWN {
        wires.pins[group].solder(pin, false);
    }
    let mut cost = Cost::default();
    let mut outside = Outside { follows, ..Outside::default() };
    // The crystal takes half a second to start.
    let mut limit = Cycles::from_millis(2_000);
    let mut end = u64::MAX;
    let mut before = 0;
    while chip.now().0 < end {
        let awake = chip.awake();
        let mut entered = chip.now().0;
        while exception(&chip) != TICK {
            entered = chip.now().0;
            chip.step();
            if chip.now() > limit {
                return Err(format!("no tick by {:.1} ms", limit.as_secs_f64() * 1e3).into());
            }
        }
        limit = chip.now() + 48_000;
        count(&mut chip, &mut cost.between);
        while exception(&chip) != 0 {
            chip.step();
        }
        count(&mut chip, &mut cost.in_ticks);
        match end {
            // The time before the first tick is the start-up.
            u64::MAX => (end, cost) = (chip.now().0 + SECONDS * 48_000_000, Cost::default()),
            _ => {
                cost.ticks.push(chip.now().0 - entered);
                cost.awake.push(chip.awake() - awake);
                cost.overruns += (entered - before + PERIOD / 2) / PERIOD - 1;
            }
        }
        before = entered;
        outside.act(&mut chip, cost.ticks.len());
    }
    Ok(cost)
}

/// Adds what the functions took since the last time.
fn count(chip: &mut Chip, functions: &mut Functions) {
    for (name, cycles) in chip.set_profiling(true).iter().flat_map(|profile| profile.functions()) {
        *functions.entry(name.to_owned()).or_default() += cycles;
    }
}

/// The exception that is served, 0 in thread mode.
fn exception(chip: &Chip) -> u32 {
    chip.cpu().registers().xpsr & 0x3f
}

/// Whom the node hears and what it feels.
#[derive(Default)]
struct Outside {
    /// The node hears a knee.
    follows: bool,
    next: u64,
    sequence: u16,
    gait: usize,
}

impl Outside {
    fn act(&mut self, chip: &mut Chip, tick: usize) {
        let (now, ms) = (chip.now(), tick as f32 * 0.1);
        for (input, counts) in INPUTS.into_iter().zip(readings(ms)) {
            chip.wires_mut().analog[0][input] = (counts + 0.5) * SUPPLY / 4096.0;
        }
        if now.0 >= self.next {
            self.next = now.0.max(self.next) + MOTION;
            self.sequence = self.sequence.wrapping_add(1);
            let motion = motion(self.sequence, ms);
            hear(chip, now + FRAME / 6, &Message::Motion(motion));
            if self.follows && self.sequence.is_multiple_of(60) {
                use GaitEvent::{CycleEnd, CycleStart, LiftOff, Touchdown};
                let (event, cycle) = ([CycleStart, LiftOff, Touchdown, CycleEnd][self.gait % 4], self.gait / 4);
                let swing = Side::BOTH[cycle % 2];
                let gait = Gait { event, swing, cycle: cycle as u32, generation: 0 };
                hear(chip, now + FRAME, &Message::Gait(gait));
                self.gait += 1;
            }
        }
        // The bus: lets everyone join, and takes every frame at once.
        let port = &mut chip.wires_mut().can[0];
        if port.timing.is_some() && port.joining != 0 {
            port.joining = 0;
            port.events.push_back((now, CanEvent::Joined));
        }
        if port.offered.is_some() && !port.transmitting {
            port.transmitting = true;
            port.events.push_back((now + FRAME, CanEvent::Sent));
        }
    }
}

fn hear(chip: &mut Chip, at: Cycles, message: &Message) {
    let frame = message.encode();
    let mut data = [0; 64];
    data[..frame.data.len()].copy_from_slice(&frame.data);
    let frame = CanFrame {
        id: frame.id.into(),
        extended: false,
        fd: true,
        bit_rate_switch: true,
        error_state: false,
        remote: false,
        length: frame.data.len() as u8,
        data,
    };
    chip.wires_mut().can[0].events.push_back((at, CanEvent::Received(frame)));
}

/// Up and down between −1 and 1 in `period`.
fn swing(ms: f32, period: f32) -> f32 {
    4.0 * ((ms / period).fract() - 0.5).abs() - 1.0
}

/// Joints that move through their ranges, feet that lift and land.
fn readings(ms: f32) -> [f32; 6] {
    let pad = |ms: f32| if (ms / 250.0).fract() > 0.7 { 66.0 } else { 164.0 };
    let (left, right) = (pad(ms), pad(ms + 125.0));
    [2048.0 + 900.0 * swing(ms, 160.0), 2048.0 + 900.0 * swing(ms, 190.0), left, left, right, right]
}

/// A trunk that sways through everything LPG1 distinguishes; armed after 20 ms.
fn motion(sequence: u16, ms: f32) -> Motion {
    let (x, y) = (swing(ms, 300.0), swing(ms, 470.0));
    Motion {
        sequence,
        mode: if ms > 20.0 { Mode::Armed } else { Mode::Braked },
        acceleration: Q16::from_f32(9.81 + 2.0 * x * y),
        rotation: Q16::from_f32(0.5 * x.abs() + 0.1 * y),
        rate: [x, 0.7 * y].map(Q16::from_f32),
        slow_rate: [0.9 * x, 0.6 * y].map(Q16::from_f32),
        lean: [0.1 * y, 0.1 * x].map(Q16::from_f32),
    }
}
