//! The robot itself, drawn from its own trace: boxes in space, one picture per instant.

use super::robot::{Block, Part, Pose, blocks};
use super::svg::{Anchor, Sheet, Stroke, Text};
use super::theme::{INK, LARGE, MUTED, NORMAL, PUSH, SMALL};
use super::{Figure, Push};

/// Pixels per metre.
const SCALE: f64 = 205.0;
const FRAME_WIDTH: f64 = 168.0;
/// Where the ground is, px from the top.
const GROUND: f64 = 272.0;

/// A row of pictures, left to right in time, seen from the right and a little above. The push, if given, is an arrow in
/// the frame nearest to it. Feet that carry, by heel or toe, are dark.
pub fn filmstrip(title: &str, frames: &[Pose], push: Option<Push>) -> Figure {
    let width = 40.0 + FRAME_WIDTH * frames.len().max(1) as f64;
    let mut sheet = Sheet::new(width, 330.0);
    sheet.rect([0.0, GROUND - 30.0], [width, 60.0], "#f1f4f7", 1.0);
    sheet.line([0.0, GROUND - 30.0], [width, GROUND - 30.0], Stroke::new("#dde3e9", 1.0));
    if !title.is_empty() {
        sheet.text([20.0, 30.0], title, Text::new(LARGE + 2.0).bold());
    }
    let pushed = push.and_then(|push| {
        let away = |index: &usize| (frames[*index].t_s - push.at_s).abs();
        (0..frames.len()).min_by(|a, b| away(a).total_cmp(&away(b)))
    });
    for (index, frame) in frames.iter().enumerate() {
        let middle = 20.0 + FRAME_WIDTH * (index as f64 + 0.5);
        let camera = Camera::following(middle, frame);
        draw(&mut sheet, &camera, frame);
        if let Some(push) = push.filter(|_| pushed == Some(index)) {
            draw_push(&mut sheet, &camera, frame, push);
        }
        let text = match push {
            Some(_) if pushed == Some(index) => "push".into(),
            Some(push) => format!("{:+.1} s", frame.t_s - push.at_s).replace('-', "\u{2212}"),
            None => format!("{:.1} s", frame.t_s),
        };
        sheet.text([middle, 320.0], &text, Text::new(NORMAL).color(MUTED).anchor(Anchor::Middle));
    }
    sheet.finish()
}

/// An orthographic camera, forward pointing to the right and slightly towards the viewer.
struct Camera {
    middle: f64,
}

impl Camera {
    const AZIMUTH: f64 = 0.62;
    const ELEVATION: f64 = 0.20;
    /// How far a robot may move from the middle of its frame before the camera goes with it, m.
    const LEASH: f64 = 0.10;

    /// A camera for one frame: a robot that has wandered off does not walk into its neighbour.
    fn following(middle: f64, pose: &Pose) -> Self {
        let (at, _) = Camera { middle: 0.0 }.project(pose.trunk_m.map(f64::from));
        let leash = SCALE * Self::LEASH;
        Camera { middle: middle - (at[0] - at[0].clamp(-leash, leash)) }
    }

    /// Pixels, and the distance towards the viewer.
    fn project(&self, [x, y, z]: [f64; 3]) -> ([f64; 2], f64) {
        let (sa, ca) = Self::AZIMUTH.sin_cos();
        let (se, ce) = Self::ELEVATION.sin_cos();
        // Seen from the robot's right, its left side away: forward is to the right of the picture.
        let right = ca * x - sa * y;
        let towards = -sa * x - ca * y;
        let (up, near) = (ce * z - se * towards, ce * towards + se * z);
        ([self.middle + SCALE * right, GROUND - SCALE * up], near)
    }
}

const FACES: [([usize; 4], usize); 6] =
    [([0, 2, 6, 4], 0), ([1, 5, 7, 3], 0), ([0, 4, 5, 1], 1), ([2, 3, 7, 6], 1), ([0, 1, 3, 2], 2), ([4, 6, 7, 5], 2)];

fn draw(sheet: &mut Sheet, camera: &Camera, pose: &Pose) {
    let blocks = blocks(pose);
    // A soft shadow below each foot says how high it is.
    for block in blocks.iter().filter(|block| matches!(block.part, Part::Foot { .. })) {
        let [x, y, z] = centre(block);
        let (at, _) = camera.project([x, y, 0.0]);
        let spread = 1.0 + 2.0 * z.max(0.0);
        sheet.ellipse(at, [22.0 * spread, 8.0 * spread], INK, 0.13 / spread);
    }
    // Painter's algorithm: blocks do not intersect much, so whole blocks are sorted, then only faces that look at
    // us are drawn, for which order within a convex block does not matter.
    let mut order: Vec<(f64, &Block)> = blocks.iter().map(|block| (camera.project(centre(block)).1, block)).collect();
    // The trunk sits on the legs and we look from above: it hides them, however near a leg is.
    order.sort_by(|a, b| (a.1.part == Part::Trunk).cmp(&(b.1.part == Part::Trunk)).then(a.0.total_cmp(&b.0)));
    for (_, block) in order {
        for (face, axis) in FACES {
            let points = face.map(|corner| camera.project(block.corners[corner]).0);
            let area: f64 = (0..4).map(|i| cross(points[i], points[(i + 1) % 4])).sum();
            // Faces are listed so that those that look at us turn one way round.
            if area < 0.0 {
                continue;
            }
            let [r, g, b] = color(block.part);
            let shade = [0.90, 0.74, 1.06][axis];
            let tint = |value: f64| (value * shade).clamp(0.0, 255.0) as u8;
            let fill = format!("#{:02x}{:02x}{:02x}", tint(r), tint(g), tint(b));
            sheet.polygon(&points, &fill, 1.0, Some(Stroke::new("#ffffff", 0.7)));
        }
    }
}

fn draw_push(sheet: &mut Sheet, camera: &Camera, pose: &Pose, push: Push) {
    let angle = f64::from(push.direction_deg).to_radians();
    let [x, y, z] = pose.trunk_m.map(f64::from);
    let along = |distance: f64| [x + distance * angle.cos(), y + distance * angle.sin(), z + 0.04];
    let (from, _) = camera.project(along(-0.40));
    let (to, _) = camera.project(along(-0.17));
    sheet.arrow(from, to, Stroke::new(PUSH, 5.0));
    let label = format!("{:.0} N·s", push.impulse_n_s);
    // Above the robot, where nothing else is.
    let ([middle, height], _) = camera.project([x, y, z]);
    let at = [middle, height - 0.32 * SCALE];
    sheet.text(at, &label, Text::new(SMALL + 1.0).color(PUSH).bold().anchor(Anchor::Middle));
}

fn centre(block: &Block) -> [f64; 3] {
    std::array::from_fn(|axis| block.corners.iter().map(|corner| corner[axis]).sum::<f64>() / 8.0)
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn color(part: Part) -> [f64; 3] {
    match part {
        Part::Trunk => [0.0, 114.0, 178.0],
        Part::Upper => [98.0, 111.0, 126.0],
        Part::Lower => [158.0, 170.0, 183.0],
        Part::Foot { loaded: true } => [38.0, 50.0, 64.0],
        Part::Foot { loaded: false } => [205.0, 213.0, 221.0],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_frames_draw_an_empty_strip() {
        assert!(filmstrip("", &[], None).svg.starts_with("<svg"));
    }

    #[test]
    fn the_arrow_stands_in_the_frame_of_the_push_and_nowhere_else() {
        let pose = |t_s| Pose {
            t_s,
            trunk_m: [0.0, 0.0, 0.84],
            trunk_quat: [0.0, 0.0, 0.0, 1.0],
            joints: [0.0; 6],
            pads_n: [80.0; 4],
        };
        let push = Push { at_s: 2.0, direction_deg: 90.0, impulse_n_s: 14.0 };
        let svg = filmstrip("", &[pose(1.7), pose(2.05), pose(2.35)], Some(push)).svg;
        assert_eq!((svg.matches(">14 N·s<").count(), svg.matches(">push<").count()), (1, 1));
        assert!(svg.contains(">−0.3 s<") && svg.contains(">+0.3 s<"), "{svg}");
    }

    #[test]
    fn forward_is_right_and_up_is_up() {
        let camera = Camera { middle: 0.0 };
        let (origin, _) = camera.project([0.0; 3]);
        assert!(camera.project([1.0, 0.0, 0.0]).0[0] > origin[0]);
        assert!(camera.project([0.0, 0.0, 1.0]).0[1] < origin[1]);
        assert!(camera.project([0.0, -1.0, 0.0]).1 > 0.0, "its right side is near");
    }
}
