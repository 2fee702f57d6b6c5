//! The parameter store: whatever happens while it writes, the next boot has the old set or the new one and says which.

mod model;

use model::{Model, Torn};
use proptest::prelude::*;
use sarah_firmware::default_params;
use sarah_firmware::store::{ATTEMPTS, Loaded, ROW, SIZE, Slot, SlotState, Step, Store, WriteError};
use sarah_protocol::frame::checksum;
use sarah_protocol::params::{ParamSet, SPECS};

const BUILD: [u8; 16] = *b"test\0\0\0\0\0\0\0\0\0\0\0\0";
/// Erase, two pages, marker.
const OPERATIONS: usize = 4;

/// Set number `n`: every value differs from every other set's.
fn set(n: u32) -> ParamSet {
    let fraction = |n: u32| (n % 97) as f32 / 97.0;
    ParamSet::new(std::array::from_fn(|i| SPECS[i].min + (SPECS[i].max - SPECS[i].min) * fraction(n)))
        .expect("in range")
}

fn load(flash: &Model) -> (Store, Loaded) {
    Store::load(flash, &default_params())
}

/// Steps until the write has ended or power is gone.
fn finish(store: &mut Store, flash: &mut Model) -> Step {
    for _ in 0..200 {
        match store.step(flash) {
            Step::Busy if flash.powered => {}
            end => return end,
        }
    }
    panic!("the write never ended");
}

fn save(flash: &mut Model, n: u32) -> Step {
    let (mut store, _) = load(flash);
    assert!(store.write(&set(n), n, BUILD));
    finish(&mut store, flash)
}

fn stored(n: u32) -> Step {
    Step::Stored { generation: n }
}

/// Every way to tear an operation that is worth distinguishing.
fn tears() -> impl Iterator<Item = Torn> {
    let ends = [Torn::Before, Torn::After].into_iter();
    ends.chain((1..ROW).map(Torn::Prefix)).chain((0..400).map(Torn::Bits))
}

/// The set that was loaded, by number; `None` is the built-in one.
fn number(loaded: &Loaded) -> Option<u32> {
    let Some((slot, kept)) = loaded.from else {
        assert_eq!(loaded.set, default_params());
        return None;
    };
    assert_eq!(loaded.set, set(kept.generation), "a mixture");
    assert_eq!(loaded.slots[slot as usize], SlotState::Valid(kept), "says another slot than it used");
    assert_eq!(kept.build, BUILD);
    Some(kept.generation)
}

/// Cuts the write of `new` at every operation in every way; `then` looks at what the next boot finds.
fn every_cut(before: &Model, new: u32, mut then: impl FnMut(Model, usize, Torn)) -> u32 {
    let mut cuts = 0;
    for operation in 0..OPERATIONS {
        for torn in tears() {
            let mut flash = before.clone();
            flash.operations = 0;
            flash.cut = Some((operation, torn));
            let end = save(&mut flash, new);
            assert_eq!(end, Step::Busy, "cut at operation {operation}, yet it ended");
            then(Model::holding(flash.memory), operation, torn);
            cuts += 1;
        }
    }
    cuts
}

#[test]
fn a_power_cut_at_any_step_leaves_the_old_set_or_the_new_one() {
    // Before: nothing, one slot used, both used, and both used with the slots the other way round.
    for count in 0..4 {
        let mut before = Model::blank();
        for n in 1..=count {
            assert_eq!(save(&mut before, n), stored(n));
        }
        let old = (count > 0).then_some(count);
        let mut seen = [0, 0];
        every_cut(&before, 50, |flash, operation, torn| {
            let (_, loaded) = load(&flash);
            let found = number(&loaded);
            assert!(found == old || found == Some(50), "{operation} {torn:?}: {found:?}");
            // Only the marker makes the new set count, and what was complete counts.
            assert!(found == old || operation == 3, "{operation} {torn:?} came too early");
            assert!(found == Some(50) || operation < 3 || !matches!(torn, Torn::After), "{torn:?} was lost");
            seen[usize::from(found == Some(50))] += 1;
        });
        assert!(seen[0] > 1000 && seen[1] > 50, "{seen:?}");
    }
}

#[test]
fn after_any_cut_the_next_write_succeeds_and_survives_a_second_cut() {
    let mut before = Model::blank();
    assert_eq!(save(&mut before, 1), stored(1));
    assert_eq!(save(&mut before, 2), stored(2));
    let mut pairs = 0;
    every_cut(&before, 50, |flash, operation, torn| {
        let between = number(&load(&flash).1);
        let mut whole = flash.clone();
        assert_eq!(save(&mut whole, 60), stored(60), "after {operation} {torn:?}");
        assert_eq!(number(&load(&Model::holding(whole.memory)).1), Some(60));
        for second in 0..OPERATIONS {
            for torn in [Torn::Before, Torn::After, Torn::Prefix(7), Torn::Bits(1), Torn::Bits(2)] {
                let mut flash = flash.clone();
                flash.cut = Some((second, torn));
                save(&mut flash, 60);
                let found = number(&load(&Model::holding(flash.memory)).1);
                assert!(found == between || found == Some(60), "{operation} then {second} {torn:?}: {found:?}");
                pairs += 1;
            }
        }
    });
    assert!(pairs > 40_000, "{pairs}");
}

#[test]
fn every_partial_marker_is_either_finished_or_not() {
    // The marker page differs from blank in 8 bytes; all subsets of each byte's bits, with the others whole.
    let mut flash = Model::blank();
    assert_eq!(save(&mut flash, 1), stored(1));
    assert_eq!(save(&mut flash, 2), stored(2));
    let whole = flash.memory.clone();
    for byte in ROW + 192..ROW + 200 {
        for kept in 0..=255u8 {
            let mut memory = whole.clone();
            memory[byte] |= kept;
            let complete = memory == whole;
            let found = number(&load(&Model::holding(memory)).1);
            assert_eq!(found, Some(if complete { 2 } else { 1 }));
        }
    }
}

#[test]
fn repeated_writes_alternate_between_the_slots_and_spare_the_rest() {
    let mut flash = Model::blank();
    let (mut store, loaded) = load(&flash);
    assert_eq!(loaded.slots, [SlotState::Empty; 2]);
    for n in 1..=20 {
        assert!(store.write(&set(n), n, BUILD));
        assert_eq!(finish(&mut store, &mut flash), stored(n));
        let (slot, kept) = load(&flash).1.from.expect("stored");
        assert_eq!((slot as u32, kept.sequence), ((n + 1) % 2, n));
    }
    assert_eq!(flash.operations, 20 * OPERATIONS);
    assert!(flash.memory[SIZE..].iter().all(|byte| *byte == 0xFF));
}

/// A blank memory whose next write has this number.
fn just_before(sequence: u32) -> Model {
    let mut flash = Model::blank();
    assert_eq!(save(&mut flash, 1), stored(1));
    renumber(&mut flash, Slot::A, sequence.wrapping_sub(1));
    flash
}

fn renumber(flash: &mut Model, slot: Slot, sequence: u32) {
    patch(flash, slot, 12, &sequence.to_le_bytes());
}

/// Changes bytes of a record and makes its check sums right again.
fn patch(flash: &mut Model, slot: Slot, at: usize, bytes: &[u8]) {
    let row = &mut flash.memory[slot as usize * ROW..][..ROW];
    row[at..at + bytes.len()].copy_from_slice(bytes);
    let crc = checksum(&row[..124]).to_le_bytes();
    row[124..128].copy_from_slice(&crc);
    row[196..200].copy_from_slice(&crc);
}

#[test]
fn numbers_wrap_around_and_the_newest_still_wins() {
    for start in [u32::MAX - 2, u32::MAX, 0, i32::MAX as u32 - 1] {
        let mut flash = just_before(start);
        for n in 2..8 {
            assert_eq!(save(&mut flash, n), stored(n));
            let (_, loaded) = load(&flash);
            assert_eq!(number(&loaded), Some(n), "from {start:#x}");
            assert_eq!(loaded.from.expect("stored").1.sequence, start.wrapping_add(n - 2));
        }
    }
}

#[test]
fn generations_may_begin_anew_the_last_write_wins() {
    let mut flash = Model::blank();
    for generation in [7, 40, 2, 2, u32::MAX, 0] {
        assert_eq!(save(&mut flash, generation % 97), stored(generation % 97));
        assert_eq!(number(&load(&flash).1), Some(generation % 97));
    }
}

#[test]
fn another_schema_is_refused_named_and_kept_until_it_must_go() {
    let mut flash = Model::blank();
    for n in 1..=2 {
        assert_eq!(save(&mut flash, n), stored(n));
    }
    // Rolled back: the newer slot is another firmware's.
    let mut half = flash.clone();
    patch(&mut half, Slot::B, 8, &0xDEAD_BEEF_u32.to_le_bytes());
    let (_, loaded) = load(&half);
    assert_eq!(loaded.slots[1], SlotState::OtherSchema { schema: 0xDEAD_BEEF, sequence: 2 });
    assert_eq!(number(&loaded), Some(1));
    assert_eq!(save(&mut half, 3), stored(3));
    assert_eq!(number(&load(&half).1), Some(3));
    // Both are: the default, and the older one is sacrificed.
    for slot in Slot::ALL {
        patch(&mut flash, slot, 8, &0xDEAD_BEEF_u32.to_le_bytes());
    }
    assert_eq!(number(&load(&flash).1), None);
    assert_eq!(save(&mut flash, 4), stored(4));
    let (_, loaded) = load(&flash);
    assert_eq!(loaded.from.map(|(slot, _)| slot), Some(Slot::A));
    assert!(matches!(loaded.slots[1], SlotState::OtherSchema { sequence: 2, .. }));
}

#[test]
fn another_layout_or_a_value_outside_the_limits_is_refused_by_name() {
    let mut flash = Model::blank();
    assert_eq!(save(&mut flash, 1), stored(1));
    let mut other = flash.clone();
    patch(&mut other, Slot::A, 4, &9u16.to_le_bytes());
    assert_eq!(load(&other).1.slots[0], SlotState::OtherLayout { layout: 9 });
    for bad in [f32::NAN, f32::INFINITY, 1e9] {
        let mut other = flash.clone();
        patch(&mut other, Slot::A, 64, &bad.to_le_bytes());
        let (_, loaded) = load(&other);
        assert!(matches!(loaded.slots[0], SlotState::Refused(_)), "{:?}", loaded.slots[0]);
        assert_eq!(number(&loaded), None);
    }
}

#[test]
fn any_flipped_bit_costs_that_slot_only() {
    let mut flash = Model::blank();
    for n in 1..=2 {
        assert_eq!(save(&mut flash, n), stored(n));
    }
    let covered = (0..128).chain(192..200);
    for (byte, bit) in covered.flat_map(|byte| (0..8).map(move |bit| (byte, bit))) {
        let mut hurt = flash.clone();
        hurt.memory[ROW + byte] ^= 1 << bit;
        let (_, loaded) = load(&hurt);
        assert_eq!(number(&loaded), Some(1), "byte {byte} bit {bit}");
        assert!(matches!(loaded.slots[1], SlotState::Corrupt | SlotState::Unfinished));
        hurt.memory[byte] ^= 1 << bit;
        assert_eq!(number(&load(&hurt).1), None, "both corrupt");
    }
}

#[test]
fn a_worn_out_row_is_given_up_and_the_old_set_stays() {
    let mut flash = Model::blank();
    assert_eq!(save(&mut flash, 1), stored(1));
    flash.stuck = Some((ROW + 70, 0x10));
    flash.operations = 0;
    assert_eq!(save(&mut flash, 2), Step::Failed { generation: 2, why: WriteError::NotErased });
    assert_eq!(flash.operations, usize::from(ATTEMPTS));
    assert_eq!(number(&load(&flash).1), Some(1));
    // A page the hardware reports as failed is tried again from the start.
    let mut flash = Model::blank();
    flash.faults = vec![2, 5];
    assert_eq!(save(&mut flash, 1), stored(1));
    let mut flash = Model::blank();
    flash.faults = (0..20).collect();
    assert_eq!(save(&mut flash, 1), Step::Failed { generation: 1, why: WriteError::Fault });
}

#[test]
fn one_write_at_a_time_and_no_step_waits() {
    let mut flash = Model::blank();
    flash.latency = 9;
    let (mut store, _) = load(&flash);
    assert_eq!(store.step(&mut flash), Step::Idle);
    assert!(store.write(&set(1), 1, BUILD));
    assert!(!store.write(&set(2), 2, BUILD));
    let mut steps = 0;
    loop {
        let before = flash.operations;
        let step = store.step(&mut flash);
        assert!(flash.operations - before <= 1, "one operation a step");
        steps += 1;
        if step == stored(1) {
            break;
        }
    }
    assert!(steps > OPERATIONS * 9);
}

proptest! {
    #[test]
    fn any_content_loads_to_something_and_can_be_written_over(
        mut memory in prop::collection::vec(any::<u8>(), 512), blank in 0usize..512, n in 1u32..97,
    ) {
        memory[blank..].fill(0xFF);
        memory.resize(8192, 0xFF);
        let mut flash = Model::holding(memory);
        prop_assert_eq!(number(&load(&flash).1), None);
        prop_assert_eq!(save(&mut flash, n), stored(n));
        prop_assert_eq!(number(&load(&flash).1), Some(n));
    }

    #[test]
    fn a_life_of_writes_and_cuts_never_loses_the_last_stored_set(
        life in prop::collection::vec((1u32..97, prop::option::of((0usize..5, any::<u64>()))), 1..40),
    ) {
        let mut flash = Model::blank();
        let mut last = None;
        for (n, cut) in life {
            flash.cut = cut.map(|(at, seed)| (at, Torn::Bits(seed)));
            let end = save(&mut flash, n);
            flash = Model::holding(flash.memory);
            let found = number(&load(&flash).1);
            prop_assert!(found == Some(n) || (found == last && end != stored(n)), "{:?} {:?} {:?}", found, last, end);
            last = found;
        }
    }
}

#[test]
fn a_memory_that_stays_busy_fails_the_write_instead_of_holding_it_up_for_ever() {
    let mut flash = Model::blank();
    let (mut store, _) = load(&flash);
    assert!(store.write(&set(7), 7, BUILD));
    flash.busy = u32::MAX;
    let mut steps = 0;
    let end = loop {
        steps += 1;
        match store.step(&mut flash) {
            Step::Busy => assert!(steps < 10_000),
            end => break end,
        }
    };
    assert_eq!(end, Step::Failed { generation: 7, why: WriteError::Fault });
    flash.busy = 0;
    assert!(store.write(&set(8), 8, BUILD));
    assert_eq!(finish(&mut store, &mut flash), stored(8));
}
