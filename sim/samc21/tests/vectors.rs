//! Replays the committed instruction vectors, see `oracle/README.md`.

#[path = "../oracle/case.rs"]
mod case;

use samc21::{Chip, Image};

#[test]
fn every_committed_vector_gives_what_the_oracle_gave() {
    let vectors = include_str!("vectors/instructions.txt");
    let mut chip = Chip::new(&Image::default());
    let mut count = 0;
    for line in vectors.lines() {
        let (start, expected) = line.split_once(" | ").expect("a bar in every line");
        let case = case::Case::parse(start).expect("a readable case");
        assert_eq!(case.run(&mut chip), expected, "{start}");
        count += 1;
    }
    assert!(count > 2000, "only {count} vectors");
}
