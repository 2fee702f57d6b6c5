//! Compares register definitions with `facts.toml`.

use std::collections::BTreeMap;
use std::sync::LazyLock;

static FACTS: LazyLock<toml::Table> =
    LazyLock::new(|| include_str!("../facts.toml").parse().expect("facts.toml is TOML"));

/// A number of a section: `bases`, `interrupts`, `channels`, `dma_triggers`.
pub fn number(section: &str, name: &str) -> i64 {
    let value = FACTS[section].get(name).unwrap_or_else(|| panic!("facts.toml: no {name} in [{section}]"));
    value.as_integer().expect("an integer")
}

/// Everything in a section of numbers, by name.
pub fn numbers(section: &str) -> BTreeMap<&'static str, i64> {
    let table = FACTS[section].as_table().expect("a table");
    table.iter().map(|(name, value)| (name.as_str(), value.as_integer().expect("an integer"))).collect()
}

/// Pins that carry a signal, as (pin, function).
pub fn pins(signal: &str) -> Vec<(&'static str, char)> {
    let text = FACTS["pins"].get(signal).unwrap_or_else(|| panic!("facts.toml: no signal {signal}"));
    let split = |pin: &'static str| pin.split_once(':').expect("PIN:FUNCTION");
    let pins = text.as_str().expect("text").split(' ').map(split);
    pins.map(|(pin, function)| (pin, function.chars().next().expect("a letter"))).collect()
}

struct Field {
    bit: u32,
    width: u32,
    values: BTreeMap<u32, &'static str>,
}

struct Register {
    offset: usize,
    bytes: usize,
    count: usize,
    fields: BTreeMap<&'static str, Field>,
}

fn register(block: &str, name: &str) -> Register {
    let text = FACTS["registers"][block].get(name).unwrap_or_else(|| panic!("facts.toml: {block} has no {name}"));
    let mut words = text.as_str().expect("text").split(' ').peekable();
    let mut word = || words.next().expect("offset, bits, access");
    let offset = usize::from_str_radix(word().trim_start_matches("0x"), 16).expect("hexadecimal");
    let bytes = word().parse::<usize>().expect("bits") / 8;
    word();
    let mut count = 1;
    if let Some(array) = words.peek().and_then(|word| word.strip_prefix('x')) {
        let (n, stride) = array.split_once('/').expect("xCOUNT/STRIDE");
        assert_eq!(stride.parse::<usize>().expect("stride"), bytes, "{block}.{name} is not a plain array");
        count = n.parse().expect("count");
        words.next();
    }
    let fields = words.map(|word| {
        let (name, place) = word.split_once('=').expect("FIELD=bit+width");
        let (place, values) = place.split_once('{').unwrap_or((place, ""));
        let (bit, width) = place.split_once('+').expect("bit+width");
        let values = values.trim_end_matches('}').split(',').filter_map(|value| value.split_once(':'));
        let values = values.map(|(name, value)| (value.parse().expect("value"), name)).collect();
        (name, Field { bit: bit.parse().expect("bit"), width: width.parse().expect("width"), values })
    });
    Register { offset, bytes, count, fields: fields.collect() }
}

/// Prints a register's fields for a raw value; none for a register that is one number.
pub type Show = Option<fn(u32) -> String>;

/// Checks one member of a block.
pub fn check(block: &str, member: &str, offset: usize, bytes: usize, count: usize, show: Show) {
    let name = member.trim_end_matches('_').to_uppercase();
    let fact = register(block, &name);
    let what = format!("{block}.{name}");
    assert_eq!((offset, bytes, count), (fact.offset, fact.bytes, fact.count), "{what}: offset, bytes, count");
    let Some(show) = show else { return };
    let idle = fields(&show(0));
    let mut places: BTreeMap<&str, u32> = BTreeMap::new();
    for bit in 0..bytes as u32 * 8 {
        for (field, value) in fields(&show(1 << bit)) {
            if idle[&field] != value {
                let known = idle.keys().find(|known| **known == field).expect("same fields for every value");
                *places.entry(known).or_default() |= 1 << bit;
            }
        }
    }
    for field in idle.keys() {
        let fact_name = field.trim_end_matches('_').to_uppercase();
        let fact = fact.fields.get(fact_name.as_str()).unwrap_or_else(|| panic!("{what} has no {fact_name}"));
        let mask = u32::MAX >> (32 - fact.width) << fact.bit;
        assert_eq!(places.get(field.as_str()), Some(&mask), "{what}.{fact_name}: bits");
        for value in 0..if fact.values.is_empty() { 0 } else { 1 << fact.width } {
            let ours = fields(&show(value << fact.bit)).remove(field).expect("same fields for every value");
            let named = ours.parse::<u32>().is_err() && !ours.starts_with("Err");
            if named {
                let theirs = fact.values.get(&value).map(|name| plain(name));
                assert_eq!(Some(plain(&ours)), theirs, "{what}.{fact_name} = {value}");
            }
        }
    }
}

fn plain(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).collect::<String>().to_uppercase()
}

/// Fields and values out of a pretty-printed structure.
fn fields(pretty: &str) -> BTreeMap<String, String> {
    let mut fields: Vec<(String, String)> = Vec::new();
    for line in pretty.lines() {
        let field = line.strip_prefix("    ").filter(|rest| !rest.starts_with([' ', ')', ']']));
        match field.and_then(|rest| rest.split_once(": ")) {
            Some((name, value)) => fields.push((name.to_owned(), value.trim_end_matches(',').to_owned())),
            None => {
                if let Some((_, value)) = fields.last_mut().filter(|_| line.starts_with(' ')) {
                    value.push_str(line.trim().trim_end_matches(','));
                }
            }
        }
    }
    let bare = |value: String| match value.strip_prefix("Ok(").and_then(|rest| rest.strip_suffix(')')) {
        Some(name) => name.to_owned(),
        None => value,
    };
    fields.into_iter().map(|(name, value)| (name, bare(value))).collect()
}

/// Bytes of one member.
pub fn bytes<Block, Member>(_: fn(&Block) -> &Member) -> usize {
    size_of::<Member>()
}
