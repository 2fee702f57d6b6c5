//! Image and library, side by side.

use crate::rig::{Rig, push, step_push};

#[test]
fn armed_and_pushed_the_images_do_what_the_library_does() {
    let mut rig = Rig::new(&[step_push(), push(3.0, 12.0, 90.0)]);
    rig.robot.compare().expect("the names that comparing needs");
    rig.arm(1500);
    rig.run_until_ms(5000);
    let mirror = rig.robot.mirror().expect("comparing");
    assert_eq!(mirror.difference(), None);
    // 4.4 s of three nodes at 10 kHz.
    let compared = mirror.compared();
    assert!(compared.ticks > 130_000 && compared.commands == 2 * compared.ticks - 6, "{compared:?}");
    assert!(compared.frames > 1_200, "{compared:?}");
    assert!(rig.telemetry.steps >= 2, "{:?}", rig.telemetry);
}
