//! A robot that was just armed stands first.

use sarah_firmware::lpg::rules::KNEE;

use crate::rig::{AIR, LOADED, PUSHED, QUIET, RATES, Rig};

fn steps_within(rig: &mut Rig, us: u32) -> bool {
    rig.motion = PUSHED();
    (0..us / rig.dt_us).any(|_| !rig.tick().events.is_empty())
}

#[test]
fn a_robot_that_rocks_on_its_soles_after_it_was_set_down_takes_no_step() {
    for dt in RATES {
        let mut rig = Rig::set_down(dt);
        assert!(!steps_within(&mut rig, KNEE.stand_at_most_us - 20_000));
        assert!(steps_within(&mut rig, 40_000), "for so long, and no longer");
    }
}

#[test]
fn a_robot_that_has_stood_still_may_step() {
    for dt in RATES {
        let mut rig = Rig::set_down(dt);
        for load in [AIR, LOADED] {
            rig.load[0] = load;
            rig.motion = QUIET();
            for _ in 0..KNEE.stand_us.div_ceil(dt) {
                rig.tick();
            }
            assert_eq!(steps_within(&mut rig, 50_000), load == LOADED, "on both feet");
        }
    }
}

#[test]
fn whoever_was_braked_stands_anew() {
    let mut rig = Rig::new(1_000);
    rig.knee.abort();
    assert!(!steps_within(&mut rig, 500_000));
}
