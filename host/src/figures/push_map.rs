//! Survival over direction and strength of the push, as one disc per controller.

use super::Figure;
use super::svg::{Anchor, Sheet, Stroke, Text};
use super::theme::{LARGE, MUTED, NORMAL, PAPER, SMALL};

/// One controller's disc.
#[derive(Debug, Clone, PartialEq)]
pub struct PushMap {
    /// The controller.
    pub label: String,
    /// Impulse, N·s; direction, degrees from forward to the left; survival there, 0 to 1.
    pub cells: Vec<(f32, f32, f64)>,
}

/// Discs in a row.
const COLUMNS: usize = 3;
/// Of one disc with its names around it.
const DISC: [f64; 2] = [320.0, 330.0];
/// The innermost ring starts here: at a point, directions cannot be told apart.
const HOLE: f64 = 0.16;
const RADIUS: f64 = 118.0;
/// Fallen, half and half, survived: vermilion, near white and blue, which colour-blind readers can tell apart.
const SCALE: [[f64; 3]; 3] = [[213.0, 94.0, 0.0], [247.0, 244.0, 240.0], [0.0, 114.0, 178.0]];

/// Survival by direction (seen from above, forward up) and impulse (weakest inside).
pub fn push_map(title: &str, maps: &[PushMap]) -> Figure {
    let columns = maps.len().clamp(1, COLUMNS);
    let rows = maps.len().div_ceil(COLUMNS).max(1);
    let width = (columns as f64 * DISC[0]).max(480.0);
    let mut sheet = Sheet::new(width, 52.0 + rows as f64 * DISC[1] + 70.0);
    sheet.text([20.0, 30.0], title, Text::new(LARGE + 2.0).bold());
    for (index, map) in maps.iter().enumerate() {
        let corner = [(index % COLUMNS) as f64 * DISC[0], 52.0 + (index / COLUMNS) as f64 * DISC[1]];
        disc(&mut sheet, [corner[0] + DISC[0] / 2.0, corner[1] + 176.0], map);
        sheet.text([corner[0] + 20.0, corner[1] + 18.0], &map.label, Text::new(NORMAL).bold());
    }
    let impulses = impulses(maps.iter().flat_map(|map| &map.cells));
    let rings: Vec<String> = impulses.iter().map(f32::to_string).collect();
    let y = sheet.height - 44.0;
    let caption = format!("rings from inside: {} N·s", rings.join(", "));
    sheet.text([20.0, y + 32.0], &caption, Text::new(SMALL).color(MUTED));
    for step in 0..=20 {
        let fraction = f64::from(step) / 20.0;
        sheet.rect([20.0 + f64::from(step) * 8.0, y - 12.0], [8.5, 14.0], &color(fraction), 1.0);
    }
    sheet.text([196.0, y], "0 to 100 % survived", Text::new(SMALL).color(MUTED));
    sheet.finish()
}

fn impulses<'a>(cells: impl Iterator<Item = &'a (f32, f32, f64)>) -> Vec<f32> {
    let mut impulses: Vec<f32> = cells.map(|cell| cell.0).filter(|impulse| impulse.is_finite()).collect();
    impulses.sort_by(f32::total_cmp);
    impulses.dedup();
    impulses
}

fn disc(sheet: &mut Sheet, centre: [f64; 2], map: &PushMap) {
    let rings = impulses(map.cells.iter());
    let at = |degrees: f64, share: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        [centre[0] - RADIUS * share * sin, centre[1] - RADIUS * share * cos]
    };
    let share = |ring: usize| HOLE + (1.0 - HOLE) * ring as f64 / rings.len().max(1) as f64;
    for (ring, impulse) in rings.iter().enumerate() {
        let cells: Vec<_> = map.cells.iter().filter(|cell| cell.0 == *impulse).collect();
        let half = 180.0 / cells.len().max(1) as f64;
        for (_, direction, survival) in cells {
            let direction = f64::from(*direction);
            // Five points an arc: round enough at this size.
            let arc = |share: f64| (-2..=2).map(move |part| at(direction + half * f64::from(part) / 2.0, share));
            let outline: Vec<_> = arc(share(ring)).chain(arc(share(ring + 1)).rev()).collect();
            sheet.polygon(&outline, &color(*survival), 1.0, Some(Stroke::new(PAPER, 0.6)));
        }
    }
    for (degrees, name) in [(0.0, "forward"), (90.0, "left"), (180.0, "backward"), (270.0, "right")] {
        let [x, y] = at(degrees, 1.06);
        let (anchor, y) = match name {
            "left" => (Anchor::End, y + 4.0),
            "right" => (Anchor::Start, y + 4.0),
            "backward" => (Anchor::Middle, y + 10.0),
            _ => (Anchor::Middle, y),
        };
        sheet.text([x, y], name, Text::new(SMALL).color(MUTED).anchor(anchor));
    }
}

fn color(survival: f64) -> String {
    let at = survival.clamp(0.0, 1.0) * 2.0;
    let (low, part) = if at < 1.0 { (0, at) } else { (1, at - 1.0) };
    let mixed = [0, 1, 2].map(|channel| SCALE[low][channel] * (1.0 - part) + SCALE[low + 1][channel] * part);
    let [red, green, blue] = mixed.map(|value| value.round() as u8);
    format!("#{red:02x}{green:02x}{blue:02x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_run_from_vermilion_to_blue() {
        assert_eq!([0.0, 0.5, 1.0].map(color), ["#d55e00", "#f7f4f0", "#0072b2"]);
    }

    #[test]
    fn every_cell_is_a_sector_and_an_empty_map_is_no_failure() {
        let cells = vec![(12.0, 0.0, 1.0), (12.0, 90.0, 1.0), (12.0, 180.0, 0.5), (12.0, 270.0, 0.0), (24.0, 0.0, 0.0)];
        let svg = push_map("Map", &[PushMap { label: "braked".into(), cells }]).svg;
        assert_eq!(svg.matches("<polygon").count(), 5);
        assert!(svg.contains("rings from inside: 12, 24 N·s"));
        assert!(!push_map("Map", &[]).svg.contains("NaN"));
    }
}
