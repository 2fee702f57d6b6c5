//! From a host's word to its effect: parameter sets and emergency stops, one after another.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use sarah_protocol::host::{Command, Which};
use sarah_protocol::newer;
use sarah_protocol::params::{ParamSet, SPECS};
use sarah_protocol::session::News;
use sarah_protocol::telemetry::Event;
use sarah_sim::world::World;

use super::BenchError;
use super::wire::{PATIENCE_US, Wire};

/// A frame that waits for the bus is on it by then, µs.
const ON_THE_BUS_US: u64 = 2_000;

/// Times of many tries, ms.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Times {
    sorted_ms: Vec<f64>,
}

impl Times {
    fn of(times_us: Vec<u64>) -> Times {
        let mut sorted_ms: Vec<f64> = times_us.into_iter().map(|us| us as f64 * 1e-3).collect();
        sorted_ms.sort_by(f64::total_cmp);
        Times { sorted_ms }
    }

    /// Number of tries.
    pub fn count(&self) -> usize {
        self.sorted_ms.len()
    }

    /// The time that the share `p` of the tries did not exceed, ms; 0 without any.
    pub fn quantile(&self, p: f64) -> f64 {
        let last = self.sorted_ms.len().saturating_sub(1);
        self.sorted_ms.get((last as f64 * p).ceil() as usize).copied().unwrap_or(0.0)
    }
}

/// Asks for `tries` random sets. Each must come into force whole, under a newer number than the one before, and no number
/// twice. The robot may go to a set of its own in between, as it does when its host was silent for long.
pub fn parameters<W: World>(wire: &mut Wire<W>, tries: u32, seed: u64, tick: &dyn Fn()) -> Result<Times, BenchError> {
    wire.connect()?;
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let (mut times, mut news, mut told) = (vec![], vec![], None);
    let mut last = wire.client.session().applied();
    for _ in 0..tries {
        let now = *wire.client.applied().ok_or_else(|| wire.broken("the set in force is not known".into()))?;
        let set = within_reach(&now, &mut rng);
        wire.client.set_params(set);
        let began_us = wire.world.now_us();
        while !wire.client.settled() || wire.client.applied() != Some(&set) {
            wire.look(&mut news)?;
            for item in news.drain(..) {
                if let News::Event { event: Event::Applied { generation, .. }, .. } = item
                    && told.replace(generation) == Some(generation)
                {
                    return Err(wire.broken(format!("generation {generation} came into force twice")));
                }
            }
            if wire.world.now_us() - began_us > PATIENCE_US {
                return Err(wire.broken("a set does not come into force".into()));
            }
        }
        times.push(wire.world.now_us() - began_us);
        let generation = wire.client.session().applied();
        if !newer(generation, last) {
            return Err(wire.broken(format!("generation {generation} followed {last}")));
        }
        last = generation;
        wire.client.session_mut().get_params(Which::Applied).map_err(|why| wire.broken(why.to_string()))?;
        let mut held = None;
        wire.until("the set in force", |news| {
            if let News::Params(report) = news {
                held = report.params.map(|set| (report.generation, set));
            }
            held.is_some()
        })?;
        if held != Some((generation, *set.values())) {
            return Err(wire.broken(format!("generation {generation} is {:?}, in force is {held:?}", set.values())));
        }
        tick();
    }
    Ok(Times::of(times))
}

/// Emergency stops of an armed robot; `seen` says whether the effect is there.
pub fn stops<W: World>(
    wire: &mut Wire<W>,
    tries: u32,
    tick: &dyn Fn(),
    mut seen: impl FnMut(&mut W) -> Option<u64>,
) -> Result<(Times, Times), BenchError> {
    wire.connect()?;
    let (mut effect, mut answer) = (vec![], vec![]);
    for number in 0..tries {
        arm(wire)?;
        // Every phase of the coordinator's turn and of the bus.
        wire.idle(u64::from(number % 37) * 100)?;
        _ = seen(&mut wire.world);
        let asked_us = wire.world.now_us();
        wire.client.session_mut().e_stop();
        let halted = |news: &News| matches!(news, News::Event { event: Event::Halted(_), .. });
        answer.push(wire.until("the stop", halted)?);
        // The host may hear of it while the frame to the nodes is still on the bus.
        let at_us = match seen(&mut wire.world) {
            Some(at_us) => Some(at_us),
            None => {
                wire.idle(ON_THE_BUS_US)?;
                seen(&mut wire.world)
            }
        };
        let at_us = at_us.ok_or_else(|| wire.broken("the halt was told but not sent to the nodes".into()))?;
        effect.push(at_us.saturating_sub(asked_us));
        wire.client.session_mut().clear_e_stop().map_err(|why| wire.broken(why.to_string()))?;
        wire.until("the clearing", |news| matches!(news, News::Done(Command::ClearEStop)))?;
        tick();
    }
    Ok((Times::of(effect), Times::of(answer)))
}

/// Arms, as often as it takes: right after power-up the IMU still finds up.
pub fn arm<W: World>(wire: &mut Wire<W>) -> Result<(), BenchError> {
    let mut refused = None;
    for _ in 0..100 {
        wire.client.session_mut().arm().map_err(|why| wire.broken(why.to_string()))?;
        wire.until("an answer to arm", |news| match news {
            News::Done(Command::Arm { .. }) => {
                refused = None;
                true
            }
            News::Refused(Command::Arm { .. }, refusal) => {
                refused = Some(*refusal);
                true
            }
            _ => false,
        })?;
        if refused.is_none() {
            return Ok(());
        }
        wire.idle(50_000)?;
    }
    let why = refused.map(|refusal| refusal.to_string()).unwrap_or_default();
    Err(wire.broken(format!("the robot does not arm: {why}")))
}

/// A random set that one generation may reach from `now`.
pub(super) fn within_reach(now: &ParamSet, rng: &mut Pcg64Mcg) -> ParamSet {
    let values = SPECS.each_ref().map(|spec| rng.random_range(spec.min..=spec.max));
    // Drawn within the ranges, so it is a set.
    let far = ParamSet::new(values).unwrap_or(*now);
    now.towards(&far)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_of_the_sorted_tries() {
        let times = Times::of(vec![3000, 1000, 2000, 4000]);
        assert_eq!((times.quantile(0.0), times.quantile(0.5), times.quantile(1.0)), (1.0, 3.0, 4.0));
        assert_eq!(Times::default().quantile(0.5), 0.0);
    }
}
