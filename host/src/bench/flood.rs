//! What a host that never stops talking costs the control ticks of the emulated chips: awake cycles, and when they begin.

use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use sarah_protocol::session::News;
use sarah_sim::awake::Summary;
use sarah_sim::emulated::Emulated;
use sarah_sim::world::World;

use super::BenchError;
use super::latency::{arm, within_reach};
use super::wire::Wire;

/// Telemetry frames per second, the most there are.
const TELEMETRY_HZ: u16 = 1_000;

/// Runs the robot for `seconds`, armed; `flooded`: the host sends new sets one after another and wants telemetry a
/// thousand times a second.
pub fn flood(world: Emulated, seconds: f64, flooded: bool, seed: u64) -> Result<([Summary; 4], u64), BenchError> {
    let mut wire = Wire::new(world);
    wire.world.measure()?;
    wire.connect()?;
    arm(&mut wire)?;
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    if flooded {
        let rate = wire.client.session_mut().set_telemetry(TELEMETRY_HZ);
        rate.map_err(|why| wire.broken(why.to_string()))?;
    }
    let (mut sets, mut news) = (0, vec![]);
    let end_us = wire.world.now_us() + (seconds * 1e6) as u64;
    while wire.world.now_us() < end_us {
        if flooded
            && wire.client.settled()
            && let Some(now) = wire.client.applied()
        {
            let next = within_reach(&now.clone(), &mut rng);
            wire.client.set_params(next);
        }
        wire.look(&mut news)?;
        sets += news.drain(..).filter(|item| matches!(item, News::Applied { .. })).count() as u64;
    }
    let awake = wire.world.awake().ok_or_else(|| wire.broken("nothing was measured".into()))?;
    Ok((awake, sets))
}
