//! Sets as people and programs read them: pure, values in, text out.

use std::fmt::Write;

use sarah_protocol::host::Which;
use sarah_protocol::params::{ParamSet, SPECS, Spec};
use serde_json::{Map, Value, json};

use super::errand::{Known, RobotSets};
use super::source::name;

/// Width of the scale that shows where in its range a value stands.
const SCALE: usize = 12;

/// All thirteen of one set, with what they are and may be.
pub fn one(title: &str, set: &ParamSet) -> String {
    let mut text = format!("{title}\n");
    line(&mut text, &["", "value", "unit", "range", "", "what it does"]);
    for (spec, value) in SPECS.iter().zip(set.values()) {
        let range = format!("{} to {}", spec.min, spec.max);
        line(&mut text, &[spec.symbol, &value.to_string(), spec.unit, &range, &scale(spec, *value), spec.meaning]);
    }
    text
}

fn line(text: &mut String, [symbol, value, unit, range, scale, meaning]: &[&str; 6]) {
    let row = format!("{symbol:<4}{value:>9}  {unit:<11}  {range:<12}  {scale:<SCALE$}  {meaning}");
    // Writing into a string cannot fail, here and below.
    let _ = writeln!(text, "{}", row.trim_end());
}

fn scale(spec: &Spec, value: f32) -> String {
    let share = ((value - spec.min) / (spec.max - spec.min)).clamp(0.0, 1.0);
    let at = (share * (SCALE - 1) as f32).round() as usize;
    (0..SCALE).map(|cell| if cell == at { '●' } else { '─' }).collect()
}

/// The robot's three sets side by side, and what they are.
pub fn robot(port: &str, sets: &RobotSets) -> String {
    let mut text = format!("robot on {port}\n");
    let column = |known: &Option<Known>, cell: &dyn Fn(&Known) -> String| known.as_ref().map_or("-  ".into(), cell);
    let _ = writeln!(text, "    {:>8}{:>8}  {:>8}", "applied", "staged", "stored");
    for (index, spec) in SPECS.iter().enumerate() {
        let now = sets.applied.as_ref().map(|known| known.set.values()[index]);
        let cell = |known: &Known| {
            let value = known.set.values()[index];
            format!("{value}{}", if Some(value) == now { "  " } else { " ≠" })
        };
        let applied = column(&sets.applied, &|known| known.set.values()[index].to_string());
        let (staged, stored) = (column(&sets.staged, &cell), column(&sets.stored, &cell));
        let range = format!("{} to {}", spec.min, spec.max);
        let place = now.map_or(String::new(), |now| scale(spec, now));
        let row = format!(
            "{:<4}{applied:>8}{staged:>10}{stored:>10}  {:<11} {range:<12} {place:<SCALE$} {}",
            spec.symbol, spec.unit, spec.meaning
        );
        let _ = writeln!(text, "{}", row.trim_end());
    }
    let _ = writeln!(
        text,
        "applied: in force in all three nodes{}",
        sets.applied.as_ref().map_or(String::new(), |known| format!(", generation {}", known.generation))
    );
    let _ = match &sets.staged {
        Some(known) => writeln!(
            text,
            "staged:  generation {}, held by the nodes; waits for its commit or for a cycle boundary",
            known.generation
        ),
        None => writeln!(text, "staged:  nothing waits"),
    };
    let _ = writeln!(
        text,
        "stored:  in memory; in force after power-up, and 10 s after the last host has gone{}",
        match (&sets.applied, &sets.stored) {
            (Some(applied), Some(stored)) if applied.set == stored.set => "; the same as applied",
            (Some(_), Some(_)) => "; `sarah params commit` makes the applied set the stored one",
            _ => "",
        }
    );
    text
}

/// What differs between two sets, or that nothing does.
pub fn diff(names: [&str; 2], sets: [&ParamSet; 2]) -> String {
    let changed = differing(sets);
    if changed.is_empty() {
        return format!("{} and {} are the same set\n", names[0], names[1]);
    }
    // A long path must not tear the table: letters stand for the names.
    let mut text = format!("A: {}\nB: {}\n", names[0], names[1]);
    let _ = writeln!(text, "    {:>10}{:>10}{:>12}  {:<11} {:>10}", "A", "B", "B - A", "unit", "of range");
    for (spec, a, b) in changed {
        let share = 100.0 * (b - a) / (spec.max - spec.min);
        let _ = writeln!(text, "{:<4}{a:>10}{b:>10}{:>+12.4}  {:<11} {share:>+8.1} %", spec.symbol, b - a, spec.unit);
    }
    text
}

fn differing([a, b]: [&ParamSet; 2]) -> Vec<(&'static Spec, f32, f32)> {
    let pairs = SPECS.iter().zip(a.values().iter().zip(b.values()));
    pairs.filter(|(_, (a, b))| a != b).map(|(spec, (a, b))| (spec, *a, *b)).collect()
}

/// One parameter for programs.
pub fn json_value(spec: &Spec, value: f32) -> Value {
    json!({
        "symbol": spec.symbol,
        "value": number(value),
        "unit": spec.unit,
        "min": number(spec.min),
        "max": number(spec.max),
        "meaning": spec.meaning,
    })
}

/// One set for programs.
pub fn json_one(title: &str, set: &ParamSet) -> Value {
    let all: Vec<Value> = SPECS.iter().zip(set.values()).map(|(spec, value)| json_value(spec, *value)).collect();
    json!({ "source": title, "parameters": all })
}

/// The robot's three sets for programs; `null` for one that is not there.
pub fn json_robot(port: &str, sets: &RobotSets) -> Value {
    let set = |known: &Option<Known>, which: Which| match known {
        None => Value::Null,
        Some(known) => {
            let values = SPECS.iter().zip(known.set.values());
            let values: Map<String, Value> =
                values.map(|(spec, value)| (spec.symbol.to_owned(), number(*value))).collect();
            match which {
                // The stored set has no generation.
                Which::Stored => json!({ "values": values }),
                _ => json!({ "generation": known.generation, "values": values }),
            }
        }
    };
    let mut all = Map::new();
    all.insert("port".into(), port.into());
    for (which, known) in sets.all() {
        all.insert(name(which).into(), set(known, which));
    }
    all.into()
}

/// What differs, for programs.
pub fn json_diff(names: [&str; 2], sets: [&ParamSet; 2]) -> Value {
    let differing: Vec<Value> = differing(sets)
        .into_iter()
        .map(|(spec, a, b)| json!({ "symbol": spec.symbol, "a": number(a), "b": number(b), "unit": spec.unit }))
        .collect();
    json!({ "a": names[0], "b": names[1], "differing": differing })
}

/// The shortest decimal that is this `f32`: 0.0213, not 0.021299999207258224.
fn number(value: f32) -> Value {
    value.to_string().parse::<f64>().map_or(Value::Null, Value::from)
}

#[cfg(test)]
mod tests {
    use sarah_firmware::default_params;

    use super::*;

    fn sets() -> RobotSets {
        let known = |generation, set| Some(Known { generation, set });
        RobotSets { applied: known(8, default_params()), staged: None, stored: known(0, ParamSet::table_ii()) }
    }

    #[test]
    fn a_set_is_shown_with_units_ranges_and_meaning() {
        let text = one("default", &default_params());
        assert_eq!(text.lines().count(), 15);
        for spec in &SPECS {
            let row = text.lines().find(|line| line.starts_with(spec.symbol)).unwrap();
            assert!(row.contains(spec.unit) && row.contains(spec.meaning) && row.contains('●'), "{row}");
            assert!(row.contains(&format!("{} to {}", spec.min, spec.max)), "{row}");
        }
    }

    #[test]
    fn the_robots_sets_stand_side_by_side_with_their_differences_marked() {
        let text = robot("/dev/ttyACM0", &sets());
        let row = text.lines().find(|line| line.starts_with("P1")).unwrap();
        let p1 = default_params().values()[0].to_string();
        assert!(row.split_whitespace().take(5).eq(["P1", p1.as_str(), "-", "0.543", "≠"]), "{row}");
        for part in
            ["applied: in force in all three nodes, generation 8", "staged:  nothing waits", "stored:  in memory"]
        {
            assert!(text.contains(part), "{part:?} is not in\n{text}");
        }
        assert!(text.contains("sarah params commit"));
        let same = RobotSets { stored: sets().applied, ..sets() };
        assert!(robot("", &same).contains("the same as applied"));
    }

    #[test]
    fn a_difference_has_sign_unit_and_share_of_the_range() {
        let mut values = *default_params().values();
        values[3] += 0.0129;
        let other = ParamSet::new(values).unwrap();
        let text = diff(["default", "runs/a"], [&default_params(), &other]);
        assert_eq!(text.lines().count(), 4, "{text}");
        assert!(text.contains("+0.0129") && text.contains("rad/s") && text.contains("+1.3 %"), "{text}");
        let same = diff(["a", "b"], [&other, &other]);
        assert_eq!(same, "a and b are the same set\n");
    }

    #[test]
    fn programs_read_the_numbers_as_they_were_written() {
        let one = json_one("table-ii", &ParamSet::table_ii());
        // As people write it, not as an f32 widened.
        assert_eq!(one["parameters"][0]["value"], json!(0.543));
        assert_eq!(one["parameters"].as_array().unwrap().len(), 13);
        let robot = json_robot("p", &sets());
        assert_eq!(robot["applied"]["generation"], json!(8));
        assert_eq!(robot["staged"], Value::Null);
        assert_eq!(robot["stored"]["values"]["P1"], json!(0.543));
        assert!(robot["stored"].get("generation").is_none());
        let diff = json_diff(["a", "b"], [&default_params(), &default_params()]);
        assert_eq!(diff["differing"], json!([]));
    }
}
