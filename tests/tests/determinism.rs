//! Equal configuration and seed, equal bits.

use std::thread;

use sarah_firmware::default_params;
use sarah_firmware::lpg::Drive;
use sarah_sim::scenario::{Episode, Scenario};
use sarah_sim::sil::Sil;
use sarah_tests::unattended;

/// The first episode of training under this seed.
fn train(seed: u64) -> Episode {
    Scenario::load("train").expect("embedded").episode(seed, 0)
}

/// Every command and the trunk's pose, bit by bit, each millisecond for ten seconds with pushes.
type Trace = Vec<([Drive; 6], [u32; 7])>;

fn trace(episode: &Episode) -> Trace {
    let mut sil = Sil::new(&unattended(), default_params(), default_params(), episode).expect("valid");
    let record = |until_us| {
        sil.run_until(until_us).expect("rapier goes on");
        let trunk = sil.robot().trunk();
        let [x, y, z] = trunk.position_m.map(f32::to_bits);
        let [qx, qy, qz, qw] = trunk.rotation_xyzw.map(f32::to_bits);
        (sil.commands(), [x, y, z, qx, qy, qz, qw])
    };
    (1..=10_000).map(|ms| ms * 1000).map(record).collect()
}

#[test]
fn the_same_seed_gives_the_same_bits_again_and_on_two_threads() {
    let episode = train(3);
    let first = trace(&episode);
    let moved = first.iter().any(|(commands, _)| commands.iter().any(|command| *command != Drive::Brake));
    assert!(moved, "the pushes of this seed make it step");
    let [one, two] = [episode.clone(), episode]
        .map(|episode| thread::spawn(move || trace(&episode)))
        .map(|run| run.join().expect("no panic"));
    // Not assert_eq: the difference would be printed.
    assert!(first == one && first == two);
}

#[test]
fn another_seed_gives_other_pushes_and_under_the_same_pushes_other_noise() {
    let episode = train(4);
    let first = trace(&episode);
    assert!(first != trace(&train(5)));
    assert!(first != trace(&Episode { seed: episode.seed ^ 2, ..episode }));
}
