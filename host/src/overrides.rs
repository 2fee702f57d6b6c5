//! Changes to a configuration, written as TOML's own dotted keys: `set.robot.payload_kg = 5.0`.
//!
//! A change is laid over the configuration's own TOML, and what comes out is read back: so unknown keys and wrong
//! types are refused by the configuration itself. A draw has the same keys and, in place of each number, the range
//! from which every episode draws its own.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::{Table, Value};

/// `base` with `changes` laid over it.
pub fn overridden<T: Serialize + DeserializeOwned>(base: &T, changes: &Table) -> Result<T, String> {
    let mut table = table_of(base)?;
    merge(&mut table, changes);
    read(table)
}

/// `base` with every number of `ranges` drawn evenly from its range; the same seed gives the same numbers.
pub fn drawn<T: Serialize + DeserializeOwned>(base: &T, ranges: &Table, seed: u64) -> Result<T, String> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    placed(base, ranges, &mut |[low, high]| {
        // The generator's top 24 bits: even over [0, 1), the same on every platform.
        let unit = f64::from(rng.random::<u32>() >> 8) / f64::from(1 << 24);
        low + (high - low) * unit
    })
}

/// `base` at the lower and at the upper ends of all ranges: what must be possible for every draw to be.
pub fn corners<T: Serialize + DeserializeOwned>(base: &T, ranges: &Table) -> Result<[T; 2], String> {
    Ok([placed(base, ranges, &mut |[low, _]| low)?, placed(base, ranges, &mut |[_, high]| high)?])
}

fn placed<T: Serialize + DeserializeOwned>(
    base: &T,
    ranges: &Table,
    choose: &mut impl FnMut([f64; 2]) -> f64,
) -> Result<T, String> {
    let mut table = table_of(base)?;
    place(&mut table, ranges, "", choose)?;
    read(table)
}

fn place(into: &mut Table, ranges: &Table, path: &str, choose: &mut impl FnMut([f64; 2]) -> f64) -> Result<(), String> {
    for (key, range) in ranges {
        let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
        if let Value::Table(inner) = range {
            let Some(Value::Table(below)) = into.get_mut(key) else { return Err(format!("{path} is not known")) };
            place(below, inner, &path, choose)?;
        } else {
            let chosen = choice(into.get(key), range, &path, choose)?;
            into.insert(key.clone(), chosen);
        }
    }
    Ok(())
}

/// The number for a range, or the list of numbers for a list of ranges.
fn choice(
    present: Option<&Value>,
    range: &Value,
    path: &str,
    choose: &mut impl FnMut([f64; 2]) -> f64,
) -> Result<Value, String> {
    let wrong = || format!("{path} must be a range, [low, high], or a list of them");
    let parts = range.as_array().ok_or_else(wrong)?;
    if parts.iter().all(Value::is_array) && !parts.is_empty() {
        let chosen: Result<Vec<Value>, String> = parts.iter().map(|part| choice(None, part, path, choose)).collect();
        return Ok(Value::Array(chosen?));
    }
    let [Some(low), Some(high)] = [0, 1].map(|end| parts.get(end).and_then(number)) else { return Err(wrong()) };
    if parts.len() != 2 {
        return Err(wrong());
    }
    if low > high {
        return Err(format!("{path} = [{low}, {high}] runs backwards; put the smaller number first"));
    }
    let value = choose([low, high]);
    Ok(match present {
        Some(Value::Integer(_)) => Value::Integer(value.round() as i64),
        _ => Value::Float(value),
    })
}

fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Integer(value) => Some(*value as f64),
        Value::Float(value) if value.is_finite() => Some(*value),
        _ => None,
    }
}

/// Tables are merged, everything else replaced.
pub fn merge(into: &mut Table, changes: &Table) {
    for (key, change) in changes {
        match (into.get_mut(key), change) {
            (Some(Value::Table(below)), Value::Table(change)) => merge(below, change),
            _ => {
                into.insert(key.clone(), change.clone());
            }
        }
    }
}

fn table_of<T: Serialize>(value: &T) -> Result<Table, String> {
    Table::try_from(value).map_err(|error| one_line(&error.to_string()))
}

fn read<T: DeserializeOwned>(table: Table) -> Result<T, String> {
    table.try_into().map_err(|error: toml::de::Error| one_line(&error.to_string()))
}

/// A parser's message in one line.
pub fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use sarah_sim::sil::SilConfig;

    use super::*;

    fn table(text: &str) -> Table {
        text.parse().unwrap()
    }

    #[test]
    fn dotted_keys_change_what_they_name_and_nothing_else() {
        let changes =
            table("robot.payload_kg = 5\nrobot.friction = 0.4\nsensors.imu_delay_s = 0.03\nlpg_rate_hz = 1000");
        let mut expected = SilConfig { lpg_rate_hz: 1000, ..SilConfig::default() };
        (expected.robot.payload_kg, expected.robot.friction) = (5.0, Some(0.4));
        expected.sensors.imu_delay_s = 0.03;
        assert_eq!(overridden(&SilConfig::default(), &changes), Ok(expected));
        assert_eq!(overridden(&SilConfig::default(), &Table::new()), Ok(SilConfig::default()));
    }

    #[test]
    fn one_weak_actuator_is_set_as_a_table_and_its_scales_can_then_be_drawn() {
        let weak = table("robot.weak_actuator = { joint = 'left-knee', force_scale = 0.8, speed_scale = 0.8 }");
        let set = overridden(&SilConfig::default(), &weak).unwrap();
        let scales = |config: &SilConfig| config.robot.weak_actuator.map(|weak| (weak.force_scale, weak.speed_scale));
        assert_eq!(scales(&set), Some((0.8, 0.8)));
        let [low, high] = corners(&set, &table("robot.weak_actuator.force_scale = [0.5, 1.0]")).unwrap();
        assert_eq!((scales(&low), scales(&high)), (Some((0.5, 0.8)), Some((1.0, 0.8))));
    }

    #[test]
    fn what_is_not_known_is_refused_by_name_in_one_line() {
        for text in ["robot.paylod_kg = 5", "robto.payload_kg = 5", "paylod_kg = true"] {
            let error = overridden(&SilConfig::default(), &table(text)).unwrap_err();
            assert!(error.contains("unknown field") && !error.contains('\n'), "{error}");
        }
    }

    #[test]
    fn draws_stay_in_their_ranges_and_follow_from_the_seed() {
        let ranges = table(
            "robot.mass_scale = [0.9, 1.1]\nrobot.com_shift_m = [[-0.03, 0.03], [0, 0], [0.01, 0.02]]\n\
             robot.friction = [0.4, 1.2]\nbus_latency_us = [100, 900]\nsensors.imu_delay_s = [0.0, 0.09]",
        );
        let draw = |seed| drawn(&SilConfig::default(), &ranges, seed).unwrap();
        assert_eq!(draw(3), draw(3));
        assert_ne!(draw(3), draw(4));
        for SilConfig { robot, sensors, bus_latency_us, .. } in (0..100).map(draw) {
            assert!((0.0..=0.09).contains(&sensors.imu_delay_s));
            assert!((0.9..=1.1).contains(&robot.mass_scale) && (0.4..=1.2).contains(&robot.friction.unwrap()));
            let [x, y, z] = robot.com_shift_m;
            assert!(x.abs() <= 0.03 && y == 0.0 && (0.01..=0.02).contains(&z));
            assert!((100..=900).contains(&bus_latency_us));
        }
    }

    #[test]
    fn ranges_that_are_none_are_refused() {
        for (text, complaint) in [
            ("robot.mass_scale = 1.0", "must be a range"),
            ("robot.mass_scale = [0.9]", "must be a range"),
            ("robot.mass_scale = [0.9, nan]", "must be a range"),
            ("robot.mass_scale = [1.1, 0.9]", "backwards"),
            ("rboot.mass_scale = [0.9, 1.1]", "not known"),
            ("robot.mass_scael = [0.9, 1.1]", "unknown field"),
        ] {
            let error = corners(&SilConfig::default(), &table(text)).unwrap_err();
            assert!(error.contains(complaint), "{text}: {error}");
        }
    }
}
