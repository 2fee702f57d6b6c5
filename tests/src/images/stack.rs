//! The deepest the stack can get, and what can be reached from where, over the call graph of the machine code.
//!
//! - A frame is the sum of all a function pushes or subtracts, on whatever path: never too small.
//! - A call through a pointer may reach every function whose address is taken, with one exception that is known: the
//!   `poll` functions of tasks are called by their executor alone, and the control task by the interrupt executor alone.
//! - A panic ends everything and masks interrupts: it counts once, on top, and not in every path that may lead to it.
//! - Recursion has no bound; it is named, and its cycle counted once.
//! - Thread mode and every priority in use add up, with 32 + 4 bytes for each exception taken.

use std::collections::{BTreeMap, BTreeSet};

use super::elf::Image;

/// A deepest path.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Depth {
    /// Bytes.
    pub bytes: u32,
    /// Functions from the root down.
    pub path: Vec<u32>,
}

/// Which tasks an executor polls.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Tasks {
    /// Those that reach the control tick.
    Control,
    /// All others.
    Slow,
}

/// What is known of the calls of an image.
pub struct Graph<'a> {
    image: &'a Image,
    ticking: BTreeSet<u32>,
    tasks: Tasks,
    done: BTreeMap<u32, Depth>,
    open: BTreeSet<u32>,
    /// Functions at which a cycle was cut.
    pub recursive: BTreeSet<u32>,
}

impl<'a> Graph<'a> {
    /// Over `image`, of which `ticks` are the functions of the control tick; executors poll `tasks`.
    pub fn new(image: &'a Image, ticks: &[u32], tasks: Tasks) -> Graph<'a> {
        let reaches = |from: &u32| reached(image, *from).iter().any(|at| ticks.contains(at));
        let ticking = image.pointed_at.iter().copied().filter(|at| is_task(image.name(*at)) && reaches(at)).collect();
        let (done, open, recursive) = (BTreeMap::new(), BTreeSet::new(), BTreeSet::new());
        Graph { image, ticking, tasks, done, open, recursive }
    }

    fn callees(&self, function: u32) -> Vec<u32> {
        let Some(known) = self.image.functions.get(&function) else { return Vec::new() };
        let mut callees: Vec<u32> = known.calls.iter().copied().collect();
        if known.indirect {
            let executor = known.name.contains("embassy_executor::raw") && !is_task(&known.name);
            let polled = |target: &u32| self.ticking.contains(target) == (self.tasks == Tasks::Control);
            let may = |target: &&u32| match is_task(self.image.name(**target)) {
                true => executor && polled(target),
                false => !executor,
            };
            callees.extend(self.image.pointed_at.iter().filter(may));
        }
        // Within a panic its own depth is asked for.
        let panicking = panics(&known.name);
        callees.retain(|callee| panicking || !panics(self.image.name(*callee)));
        callees
    }

    /// The deepest path from `function` on.
    pub fn depth(&mut self, function: u32) -> Depth {
        if let Some(depth) = self.done.get(&function) {
            return depth.clone();
        }
        let frame = self.image.functions.get(&function).map_or(0, |known| known.frame);
        if !self.open.insert(function) {
            self.recursive.insert(function);
            return Depth::default();
        }
        let callees = self.callees(function);
        let mut deepest = Depth::default();
        for callee in callees {
            let depth = self.depth(callee);
            if depth.bytes > deepest.bytes {
                deepest = depth;
            }
        }
        self.open.remove(&function);
        deepest.bytes += frame;
        deepest.path.insert(0, function);
        self.done.insert(function, deepest.clone());
        deepest
    }

    /// A way from `root` to a function `unwanted` names; calls through pointers count as one too, for where they lead
    /// cannot be shown.
    pub fn way(&self, root: u32, unwanted: impl Fn(&str) -> bool) -> Option<Vec<u32>> {
        let mut from = BTreeMap::from([(root, root)]);
        let mut ahead = vec![root];
        while let Some(function) = ahead.pop() {
            let known = self.image.functions.get(&function);
            if unwanted(self.image.name(function)) || known.is_none_or(|known| known.indirect) {
                let mut way = vec![function];
                let mut at = function;
                while at != root {
                    at = from[&at];
                    way.insert(0, at);
                }
                return Some(way);
            }
            for callee in known.into_iter().flat_map(|known| &known.calls) {
                if !from.contains_key(callee) {
                    from.insert(*callee, function);
                    ahead.push(*callee);
                }
            }
        }
        None
    }
}

/// Everything that direct calls from `root` reach, itself included.
pub fn reached(image: &Image, root: u32) -> BTreeSet<u32> {
    let mut seen = BTreeSet::new();
    let mut ahead = vec![root];
    while let Some(at) = ahead.pop() {
        if seen.insert(at) {
            ahead.extend(image.functions.get(&at).into_iter().flat_map(|function| &function.calls));
        }
    }
    seen
}

/// Whether a function is the machinery of panics.
pub fn panics(name: &str) -> bool {
    let parts = [
        "core::panicking::",
        "rust_begin_unwind",
        "unwrap_failed",
        "expect_failed",
        "slice_index_fail",
        "core::slice::index::",
        "panic_already",
    ];
    parts.iter().any(|part| name.contains(part))
}

fn is_task(name: &str) -> bool {
    name.contains("TaskStorage<") && name.ends_with("::poll")
}

#[cfg(test)]
mod tests {
    use super::super::elf::Function;
    use super::*;

    fn image(functions: &[(u32, &str, u32, &[u32], bool)], pointed_at: &[u32]) -> Image {
        let functions = functions.iter().map(|(address, name, frame, calls, indirect)| {
            let calls = calls.iter().copied().collect();
            (*address, Function { name: (*name).into(), frame: *frame, calls, indirect: *indirect })
        });
        let pointed_at = pointed_at.iter().copied().collect();
        Image { functions: functions.collect(), pointed_at, ..Image::default() }
    }

    #[test]
    fn the_deepest_path_counts_pointers_included() {
        let image = image(
            &[
                (1, "main", 8, &[2, 3], false),
                (2, "a", 100, &[], false),
                (3, "b", 16, &[], true),
                (4, "c", 90, &[], false),
            ],
            &[4],
        );
        let depth = Graph::new(&image, &[], Tasks::Slow).depth(1);
        assert_eq!(depth, Depth { bytes: 8 + 16 + 90, path: vec![1, 3, 4] });
    }

    #[test]
    fn tasks_are_polled_by_executors_only() {
        let task = "embassy_executor::raw::TaskStorage<F>::poll";
        let image = image(
            &[(1, "embassy_executor::raw::run", 8, &[], true), (2, task, 200, &[3], false), (3, "wake", 4, &[], true)],
            &[2],
        );
        let mut graph = Graph::new(&image, &[], Tasks::Slow);
        assert_eq!(graph.depth(1).bytes, 212);
        assert!(graph.recursive.is_empty());
        // The task reaches the tick: it belongs to the interrupt executor.
        assert_eq!(Graph::new(&image, &[3], Tasks::Slow).depth(1).bytes, 8);
        assert_eq!(Graph::new(&image, &[3], Tasks::Control).depth(1).bytes, 212);
    }

    #[test]
    fn a_panic_counts_on_top_and_nowhere_else() {
        let image = image(
            &[
                (1, "main", 8, &[2, 3], false),
                (2, "core::panicking::panic", 50, &[4], false),
                (3, "a", 4, &[], false),
                (4, "die", 60, &[], false),
            ],
            &[],
        );
        let mut graph = Graph::new(&image, &[], Tasks::Slow);
        assert_eq!((graph.depth(1).bytes, graph.depth(2).bytes), (12, 110));
    }

    #[test]
    fn recursion_is_named() {
        let image = image(&[(1, "even", 8, &[2], false), (2, "odd", 8, &[1], false)], &[]);
        let mut graph = Graph::new(&image, &[], Tasks::Slow);
        assert_eq!(graph.depth(1).bytes, 16);
        assert_eq!(graph.recursive, BTreeSet::from([1]));
    }

    #[test]
    fn a_way_to_what_is_unwanted_is_shown() {
        let image = image(
            &[(1, "tick", 0, &[2], false), (2, "divide", 0, &[3], false), (3, "core::panicking::panic", 0, &[], false)],
            &[],
        );
        let graph = Graph::new(&image, &[], Tasks::Slow);
        assert_eq!(graph.way(1, |name| name.contains("panicking")), Some(vec![1, 2, 3]));
        assert_eq!(graph.way(1, |name| name.contains("sinf")), None);
    }
}
