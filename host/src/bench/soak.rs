//! A bad line for a long time: bytes lost, doubled and flipped, the cable pulled for up to a dozen seconds, stops and
//! arming in between; and a host that changes parameters as fast as it can.
//!
//! Watched all along: every set comes into force once, whole, under the next number; nothing takes longer than the
//! patience of [`super::wire`]; nobody but this host arms; frames heard and frames missed add up to frames sent.

use std::time::Instant;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use sarah_protocol::bus::Mode;
use sarah_protocol::host::Command;
use sarah_protocol::session::{LinkStats, News};
use sarah_sim::line::{BadLine, Faults};
use sarah_sim::world::World;

use super::BenchError;
use super::latency::{arm, parameters};
use super::wire::Wire;

/// Sets between two other things.
const SETS: u32 = 100;
/// The longest that the cable is out, µs: the robot goes back to its stored set after 10 s.
const PULLED_US: u64 = 12_000_000;
/// Generations go on from these, each less than half the numbers from the one before, so that they wrap around early.
const BEFORE_WRAP: [u32; 2] = [0x7fff_ff00, 0xffff_f000];
/// Memory that a soak may grow by after its first tenth, KiB.
const GROWTH_KIB: u64 = 4_096;
/// Frames that may be on their way when the counters are compared.
const ON_THE_WAY: u64 = 8;
/// Sequence numbers count up to this.
const SEQUENCE: u64 = 1 << 16;

/// What a soak came to.
#[derive(Clone, Debug)]
pub struct Soaked {
    /// Robot's time, s, and wall time, s.
    pub seconds: (f64, f64),
    /// Sets changed.
    pub sets: u64,
    /// Emergency stops.
    pub stops: u64,
    /// Times the cable was pulled, and how long altogether, s.
    pub pulled: (u64, f64),
    /// Bytes that something happened to.
    pub hit: u64,
    /// The host's counters at the end.
    pub stats: LinkStats,
    /// Frames that the robot sent.
    pub sent: u64,
    /// Wrap-arounds of the robot's sequence numbers, of its microsecond clock, and of the generations.
    pub wraps: (u64, u64, u64),
    /// Memory of this process after the first tenth and at the end, KiB.
    pub rss_kib: (u64, u64),
}

/// Soaks for `seconds` of the robot's time.
pub fn soak<W: World>(
    world: W,
    faults: Faults,
    seconds: f64,
    seed: u64,
    tick: &dyn Fn(f64),
) -> Result<Soaked, BenchError> {
    let began = Instant::now();
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut wire = Wire::new(BadLine::new(world, Faults::default(), seed));
    wire.connect()?;
    for before in BEFORE_WRAP {
        wire.client.session_mut().number_after(before);
        renumber(&mut wire)?;
    }
    wire.world.set_faults(faults);
    arm(&mut wire)?;
    let end_us = (seconds * 1e6) as u64;
    let (mut sets, mut stops, mut pulls, mut pulled_us) = (0, 0, 0, 0);
    let (mut wrapped, mut generation) = (0, wire.client.session().applied());
    let mut rss_early = None;
    while wire.world.now_us() < end_us {
        parameters(&mut wire, SETS, rng.random(), &|| {})?;
        sets += u64::from(SETS);
        let before = std::mem::replace(&mut generation, wire.client.session().applied());
        wrapped += u64::from(generation < before);
        if rng.random_bool(0.2) {
            stop(&mut wire)?;
            stops += 1;
        }
        if rng.random_bool(0.1) {
            pulled_us += pull(&mut wire, rng.random_range(50_000..PULLED_US))?;
            pulls += 1;
        }
        if rss_early.is_none() && wire.world.now_us() > end_us / 10 {
            rss_early = Some(rss_kib());
        }
        tick(wire.world.now_us() as f64 * 1e-6);
    }
    wire.world.set_faults(Faults::default());
    wire.idle(100_000)?;
    let stats = *wire.client.session().stats();
    let (sent, known) = (wire.world.frames(), u64::from(stats.frames) + u64::from(stats.lost));
    if known.abs_diff(sent) > ON_THE_WAY {
        return Err(wire.broken(format!("{sent} frames were sent, {known} are accounted for: {stats:?}")));
    }
    let rss_kib = (rss_early.unwrap_or_default(), rss_kib());
    if rss_kib.1 > rss_kib.0 + GROWTH_KIB {
        return Err(wire.broken(format!("memory grew from {} to {} KiB", rss_kib.0, rss_kib.1)));
    }
    Ok(Soaked {
        seconds: (wire.world.now_us() as f64 * 1e-6, began.elapsed().as_secs_f64()),
        sets,
        stops,
        pulled: (pulls, pulled_us as f64 * 1e-6),
        hit: wire.world.hit(),
        stats,
        sent,
        wraps: (sent / SEQUENCE, wire.world.now_us() >> 32, wrapped),
        rss_kib,
    })
}

/// One change, whatever its number.
fn renumber<W: World>(wire: &mut Wire<W>) -> Result<(), BenchError> {
    let now = wire.client.applied().copied();
    let other = now.map(|now| now.towards(&sarah_protocol::params::ParamSet::table_ii()));
    let goal = if other == now { Some(sarah_firmware::default_params()) } else { other };
    if let Some(goal) = goal {
        wire.client.set_params(goal);
    }
    wire.until("the first sets", |news| matches!(news, News::Applied { .. })).map(|_| ())
}

fn stop<W: World>(wire: &mut Wire<W>) -> Result<(), BenchError> {
    wire.client.session_mut().e_stop();
    wire.until("brakes", |news| matches!(news, News::Telemetry(frame) if frame.mode == Mode::Braked))?;
    wire.client.session_mut().clear_e_stop().map_err(|why| wire.broken(why.to_string()))?;
    wire.until("the clearing", |news| matches!(news, News::Done(Command::ClearEStop)))?;
    // Nobody has armed it, so it must still be braked.
    let news = wire.idle(100_000)?;
    if news.iter().any(|item| matches!(item, News::Telemetry(frame) if frame.mode == Mode::Armed)) {
        return Err(wire.broken("armed by nobody".into()));
    }
    arm(wire)
}

/// Pulls the cable, and plugs it in again; the robot must be as it was.
fn pull<W: World>(wire: &mut Wire<W>, us: u64) -> Result<u64, BenchError> {
    wire.plugged = false;
    wire.idle(us)?;
    wire.plugged = true;
    let mut mode = None;
    wire.until("the robot after the cable was pulled", |news| {
        if let News::Telemetry(frame) = news {
            mode = Some(frame.mode);
        }
        mode.is_some()
    })?;
    match mode {
        Some(Mode::Armed) => wire.connect().map(|()| us),
        _ => Err(wire.broken("a pulled cable halted the robot".into())),
    }
}

/// Resident memory of this process, KiB; 0 where the system does not say.
fn rss_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.and_then(|line| line.split_whitespace().next()?.parse().ok()).unwrap_or(0)
}
