//! The flashed images against their budget, by their machine code: flash, RAM, deepest stack, and what must not be linked
//! or reached.
//!
//! - `thumb`: instructions. `elf`: functions and sizes. `stack`: the call graph.

mod elf;
mod stack;
mod thumb;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use serde::Deserialize;

pub use elf::{Function, Image};
pub use stack::{Depth, Graph, Tasks};

use elf::{RAM, is_bridge};
use stack::{panics, reached};

/// Functions of the C mathematics library that no controller needs.
const TRANSCENDENTAL: [&str; 12] =
    ["sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "exp2", "log", "log2", "pow"];
/// What the compiler emits where memory is allocated.
const ALLOCATOR: [&str; 4] = ["__rust_alloc", "__rust_realloc", "__rg_alloc", "__rdl_alloc"];
/// Registers saved when an exception is taken, and the alignment.
const EXCEPTION: u32 = 32 + 4;

/// `firmware/budget.toml`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Budget {
    /// Bytes flashed.
    pub flash: u32,
    /// Bytes of RAM: static, and the deepest stack.
    pub ram: u32,
    /// Functions of the control tick, by image: from them, no panic may be reachable.
    pub tick: BTreeMap<String, Vec<String>>,
    /// Interrupt handlers that share a priority, so that one of them at a time is on the stack.
    pub priorities: Vec<Vec<String>>,
    /// Images whose ticks run from RAM.
    pub fast: Fast,
}

/// Images whose ticks run from RAM, where the core does not wait for the flash.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fast {
    /// Which.
    pub images: Vec<String>,
    /// The handlers that are a tick.
    pub handlers: Vec<String>,
    /// What may stay in flash, with all it calls: few ticks get there.
    pub rare: Vec<String>,
}

/// What was found of one image.
#[derive(Clone, Debug, Default)]
pub struct Findings {
    /// Lines for people.
    pub text: String,
    /// What is over budget or must not be; empty is good.
    pub complaints: Vec<String>,
}

/// Judges one image.
pub fn judge(name: &str, image: &Image, budget: &Budget) -> Findings {
    let mut findings = Findings::default();
    let roots = budget.tick.get(name).map_or(&[][..], Vec::as_slice);
    let ticks: Vec<u32> = roots.iter().flat_map(|root| image.named(root)).collect();
    let (stack, lines, recursive) = worst_stack(image, budget, &ticks);
    let ram = image.ram + stack;
    // Writing to a string cannot fail; the results are dropped for that reason.
    let text = &mut findings.text;
    let _ = writeln!(
        text,
        "{name:<12} flash {:>6} of {}   RAM {:>5} + stack {:>5} = {:>5} of {}",
        image.flash, budget.flash, image.ram, stack, ram, budget.ram
    );
    text.push_str(&lines);
    let complaints = &mut findings.complaints;
    if image.flash > budget.flash {
        complaints.push(format!("{name}: {} bytes of flash are over the budget of {}", image.flash, budget.flash));
    }
    if ram > budget.ram {
        complaints.push(format!("{name}: {ram} bytes of RAM and stack are over the budget of {}", budget.ram));
    }
    for cut in &recursive {
        let _ = writeln!(text, "             recursion through a pointer, counted once: {}", short(image.name(*cut)));
    }
    forbidden(name, image, complaints);
    tick(name, image, budget, &mut findings);
    if budget.fast.images.iter().any(|fast| fast == name) {
        fast(name, image, &budget.fast, &mut findings);
    }
    findings
}

/// Thread mode, then every priority on top of it, then one fault; with the paths in words, and where recursion was cut.
fn worst_stack(image: &Image, budget: &Budget, ticks: &[u32]) -> (u32, String, BTreeSet<u32>) {
    let mut slow = Graph::new(image, ticks, Tasks::Slow);
    let mut control = Graph::new(image, ticks, Tasks::Control);
    let mut lines = String::new();
    let mut line = |what: &str, depth: &Depth| {
        // Writing to a string cannot fail.
        let path = depth.path.iter().map(|at| image.name(*at)).filter(|name| !is_bridge(name));
        let path: Vec<&str> = path.map(short).collect();
        let _ = writeln!(lines, "             {:>5} {what}: {}", depth.bytes, path.join(" > "));
    };
    let mut left: BTreeSet<u32> = image.vectors.iter().skip(2).map(|at| at & !1).filter(|at| *at != 0).collect();
    let thread = image.vectors.get(1).map_or(Depth::default(), |at| slow.depth(at & !1));
    line("thread", &thread);
    let mut total = thread.bytes;
    for names in &budget.priorities {
        let level: Vec<u32> =
            left.iter().copied().filter(|at| names.iter().any(|name| name == image.name(*at))).collect();
        left.retain(|at| !level.contains(at));
        // An executor in an interrupt polls the control task.
        let deepest = level.iter().map(|at| control.depth(*at)).max_by_key(|depth| depth.bytes);
        if let Some(depth) = deepest {
            line("interrupt", &depth);
            total += depth.bytes + EXCEPTION;
        }
    }
    // Whoever has no priority in the budget is a fault handler, or forgotten. One of them or a panic is on top of all.
    let ends = left.into_iter().chain(image.functions.keys().copied().filter(|at| panics(image.name(*at))));
    if let Some(depth) = ends.map(|at| slow.depth(at)).max_by_key(|depth| depth.bytes) {
        line("fault", &depth);
        total += depth.bytes + EXCEPTION;
    }
    let recursive = slow.recursive.union(&control.recursive).copied().collect();
    (total, lines, recursive)
}

fn forbidden(name: &str, image: &Image, complaints: &mut Vec<String>) {
    for symbol in &image.symbols {
        let last = symbol.rsplit("::").next().unwrap_or(symbol);
        let bare = last.strip_suffix('f').unwrap_or(last);
        // The C name, or the compiler's own mathematics; a method of ours may be called `log`.
        let library =
            !symbol.contains("::") || symbol.starts_with("compiler_builtins::") || symbol.starts_with("libm::");
        if library && TRANSCENDENTAL.contains(&bare) {
            complaints.push(format!("{name}: {symbol} is linked: the tick has no float transcendentals"));
        }
        if ALLOCATOR.contains(&last) || symbol.starts_with("alloc::") {
            complaints.push(format!("{name}: {symbol} is linked: nothing is allocated dynamically"));
        }
    }
}

fn tick(name: &str, image: &Image, budget: &Budget, findings: &mut Findings) {
    let graph = Graph::new(image, &[], Tasks::Slow);
    let Some(roots) = budget.tick.get(name) else {
        findings.complaints.push(format!("{name}: firmware/budget.toml names no tick for it"));
        return;
    };
    for root in roots {
        let mut any = false;
        for at in image.named(root) {
            any = true;
            match graph.way(at, panics) {
                None => {
                    let count = reached(image, at).len();
                    let _ = writeln!(findings.text, "             {root}: {count} functions reachable, none panics");
                }
                Some(way) => {
                    let way: Vec<&str> = way.iter().map(|at| image.name(*at)).collect();
                    let what = if way.last().is_some_and(|last| panics(last)) {
                        "may panic"
                    } else {
                        "calls through a pointer"
                    };
                    findings.complaints.push(format!("{name}: the tick {what}: {}", way.join(" > ")));
                }
            }
        }
        if !any {
            findings
                .complaints
                .push(format!("{name}: no function is called {root}: was it inlined? Mark it #[inline(never)]"));
        }
    }
}

/// What direct calls reach from the handlers lies in RAM, but for what is rare.
fn fast(name: &str, image: &Image, fast: &Fast, findings: &mut Findings) {
    let rare: BTreeSet<u32> = fast.rare.iter().flat_map(|function| image.named(function)).collect();
    let mut ahead: Vec<u32> = fast.handlers.iter().flat_map(|handler| image.named(handler)).collect();
    let mut seen: BTreeSet<u32> = ahead.iter().copied().collect();
    while let Some(at) = ahead.pop() {
        if at < RAM {
            let function = image.name(at);
            findings.complaints.push(format!(
                "{name}: a tick waits for the flash in {function}: name it in board/samc21/fast.x, or as rare in budget.toml"
            ));
        }
        let calls = image.functions.get(&at).into_iter().flat_map(|function| &function.calls);
        ahead.extend(calls.copied().filter(|call| !rare.contains(call) && seen.insert(*call)));
    }
    let _ = writeln!(findings.text, "             {} functions of the tick in RAM", seen.len());
}

/// The last two words of a path.
fn short(name: &str) -> &str {
    let plain = name.split('<').next().filter(|part| !part.is_empty()).unwrap_or(name);
    plain.rmatch_indices("::").nth(1).map_or(plain, |(at, _)| &plain[at + 2..])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn budget() -> Budget {
        let text = include_str!("../../../firmware/budget.toml");
        toml::from_str(text).expect("firmware/budget.toml")
    }

    fn function(name: &str, frame: u32, calls: &[u32]) -> Function {
        Function { name: name.into(), frame, calls: calls.iter().copied().collect(), indirect: false }
    }

    /// `Reset` calls the tick, `TC4` interrupts, `HardFault` ends.
    fn image() -> Image {
        let functions = [
            (0x100, function("Reset", 16, &[0x200])),
            (0x200, function("knee::control_tick", 100, &[])),
            (0x2000_0300, function("TC4", 24, &[])),
            (0x400, function("HardFault", 8, &[])),
        ];
        let symbols = functions.iter().map(|(_, function)| function.name.clone()).collect();
        let vectors = vec![0x2000_8000, 0x101, 0, 0x401, 0x2000_0301];
        Image { functions: functions.into(), vectors, symbols, flash: 30_000, ram: 5_000, ..Image::default() }
    }

    fn complaints(image: &Image) -> Vec<String> {
        let tick = BTreeMap::from([("knee".into(), vec!["control_tick".into()])]);
        judge("knee", image, &Budget { tick, ..budget() }).complaints
    }

    #[test]
    fn what_is_within_budget_is_good_and_stacks_add_up() {
        let good = image();
        assert_eq!(complaints(&good), [""; 0]);
        let (stack, ..) = worst_stack(&good, &budget(), &[0x200]);
        assert_eq!(stack, (16 + 100) + (24 + 36) + (8 + 36));
    }

    #[test]
    fn every_excess_is_named() {
        let mut bad = Image { flash: 50_000, ram: 12_200, ..image() };
        bad.functions.insert(0x500, function("compiler_builtins::math::sinf", 8, &[]));
        bad.symbols.extend(["compiler_builtins::math::sinf".into(), "__rust_alloc".into()]);
        bad.functions.insert(0x600, function("core::panicking::panic_bounds_check", 8, &[]));
        bad.functions.entry(0x200).and_modify(|tick| _ = tick.calls.insert(0x600));
        let all = complaints(&bad).join("\n");
        for part in [
            "50000 bytes of flash",
            "RAM and stack",
            "sinf is linked",
            "__rust_alloc",
            "knee::control_tick > core::panicking",
        ] {
            assert!(all.contains(part), "{all} lacks {part}");
        }
    }

    #[test]
    fn a_fast_tick_lies_in_ram_but_for_what_is_rare() {
        let mut image = image();
        let mut fast_complaints = |calls: &[u32]| {
            image.functions.insert(0x2000_0300, function("TC4", 8, calls));
            image.functions.insert(0x2000_0200, function("__ThumbV6MABSLongThunk_wide", 8, &[0x700]));
            image.functions.insert(0x700, function("fixed::wide", 8, &[0x800]));
            image.functions.insert(0x800, function("memcpy", 8, &[]));
            let rare = Fast { images: vec![], handlers: vec!["TC4".into()], rare: vec!["wide".into()] };
            let mut findings = Findings::default();
            fast("knee", &image, &rare, &mut findings);
            findings.complaints
        };
        assert_eq!(fast_complaints(&[0x2000_0200]), [""; 0]);
        assert!(fast_complaints(&[0x800])[0].contains("waits for the flash in memcpy"));
    }

    #[test]
    fn a_tick_that_cannot_be_found_or_followed_is_a_complaint() {
        let mut bad = image();
        bad.functions.entry(0x200).and_modify(|tick| tick.indirect = true);
        assert!(complaints(&bad)[0].contains("through a pointer"));
        bad.functions.remove(&0x200);
        assert!(complaints(&bad)[0].contains("no function is called control_tick"));
    }
}
