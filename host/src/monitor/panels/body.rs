//! What the body does: gait, feet, posture.

use ratatui::text::{Line, Span};
use sarah_protocol::bus::{NodeId, Side};
use sarah_protocol::telemetry::Telemetry;

use super::super::state::Dashboard;
use super::super::text::{bar, chart};
use super::super::view::{BOLD, DIM};
use super::super::words::node;

/// Factor above this starts a step (§3 of the paper).
const THRESHOLD: f32 = 0.07;
/// Full scale of Factor's gauge and course: the threshold stands at a quarter.
const FACTOR_FULL: f32 = 4.0 * THRESHOLD;
/// A foot is loaded above this, both pads together, N.
const LOADED_N: f32 = 15.0;
/// Full scale of a pad, N: half of the robot's weight.
const PAD_FULL_N: f32 = 160.0;
/// Lean at the rim of the bubble, rad.
const RIM: f32 = 0.2;

/// Phases by name (`sarah_firmware::lpg::{knee, swing}`).
fn phase(id: NodeId, number: u8) -> String {
    let names = match id {
        NodeId::Knee => ["idle", "kick", "retract", "extend"],
        NodeId::Hip | NodeId::Abductor => ["idle", "ready", "moving", "held"],
    };
    names.get(usize::from(number)).map_or_else(|| format!("phase {number}?"), ToString::to_string)
}

fn none() -> Vec<Line<'static>> {
    vec![Line::styled(" no telemetry", DIM)]
}

pub(super) fn gait(dashboard: &Dashboard, _: u64, width: usize, rows: usize) -> Vec<Line<'static>> {
    let Some((_, telemetry)) = &dashboard.telemetry else { return none() };
    let swing = dashboard.trend.swing();
    let mut lines: Vec<Line> = NodeId::ALL
        .into_iter()
        .zip(telemetry.phases)
        .map(|(id, number)| {
            let phase = phase(id, number);
            let legs = match (number, swing) {
                (0, _) => [Span::raw(phase), Span::raw("")],
                (_, Some(Side::Left)) => [Span::styled(format!("left {phase:<8}"), BOLD), Span::raw("right holds")],
                (_, Some(Side::Right)) => [Span::raw("left holds   "), Span::styled(format!("right {phase}"), BOLD)],
                // The leg shows itself with its first movement.
                (_, None) => [Span::styled(phase, BOLD), Span::raw(" (one leg)")],
            };
            let [left, right] = legs;
            Line::from(vec![Span::raw(format!(" {:<9} ", node(id))), left, right])
        })
        .collect();
    lines.push(Line::raw(format!(
        " {:.1} steps/s   {} in all   cycle {}",
        dashboard.trend.steps_per_s(),
        telemetry.steps,
        telemetry.cycle
    )));
    let factor = telemetry.factor.to_f32();
    let verdict = if factor > THRESHOLD { ">" } else { "≤" };
    let gauge = width.saturating_sub(25).clamp(4, 24);
    let gauge = bar(factor / FACTOR_FULL, gauge, Some(THRESHOLD / FACTOR_FULL));
    let mut line = Line::raw(format!(" Factor {factor:.3} {gauge} {verdict} {THRESHOLD}"));
    if factor > THRESHOLD {
        line = line.style(BOLD);
    }
    lines.push(line);
    let height = rows.saturating_sub(lines.len()).max(1);
    let course = chart(dashboard.trend.factor(), FACTOR_FULL, THRESHOLD, width.saturating_sub(2), height);
    lines.extend(course.into_iter().map(|row| Line::raw(format!(" {row}"))));
    lines
}

pub(super) fn feet(dashboard: &Dashboard, _: u64, width: usize, rows: usize) -> Vec<Line<'static>> {
    let Some((_, telemetry)) = &dashboard.telemetry else { return none() };
    let newton = telemetry.loads.map(|tenths| f32::from(tenths) * 0.1);
    let pad = |load: f32, width: usize| bar(load / PAD_FULL_N, width, Some(LOADED_N / PAD_FULL_N));
    let mut lines = vec![];
    for (leg, name) in ["left", "right"].into_iter().enumerate() {
        let (heel, toe) = (newton[2 * leg], newton[2 * leg + 1]);
        let state = if heel + toe > LOADED_N { "loaded" } else { "in the air" };
        if rows >= 4 {
            let bars = width.saturating_sub(32).clamp(4, 40);
            lines.push(format!(" {name:<5} heel {} {heel:4.0} N  {:4.0} N", pad(heel, bars), heel + toe));
            lines.push(format!("       toe  {} {toe:4.0} N  {state}", pad(toe, bars)));
        } else {
            let bars = width.saturating_sub(24) / 2;
            let (first, second) = (pad(heel, bars), pad(toe, bars));
            let sum = if heel + toe > LOADED_N { format!("{:4.0} N", heel + toe) } else { "in air".into() };
            lines.push(format!(" {name:<5} {first}{heel:4.0} {second}{toe:4.0}  {sum}"));
        }
    }
    lines.into_iter().map(Line::raw).collect()
}

pub(super) fn posture(dashboard: &Dashboard, _: u64, width: usize, rows: usize) -> Vec<Line<'static>> {
    let Some((_, telemetry)) = &dashboard.telemetry else { return none() };
    let numbers = posture_numbers(telemetry);
    // As large as rows and columns permit, and odd, so that there is a middle.
    let height = rows.min(width.saturating_sub(28) / 2).clamp(numbers.len(), 9);
    let height = if height.is_multiple_of(2) { height - 1 } else { height };
    let bubble = bubble(telemetry, height);
    let joined = bubble.into_iter().enumerate();
    joined.map(|(row, left)| Line::raw(format!(" {left}  {}", numbers.get(row).map_or("", String::as_str)))).collect()
}

fn posture_numbers(telemetry: &Telemetry) -> [String; 5] {
    let [forward, left] = telemetry.lean.map(|lean| lean.to_f32());
    let ahead = if forward < 0.0 { "back" } else { "forward" };
    let aside = if left < 0.0 { "right" } else { "left" };
    let [l_abd, l_hip, l_knee, r_abd, r_hip, r_knee] = telemetry.joints.map(|joint| joint.to_f32());
    [
        format!("lean {:.3} rad {ahead}", forward.abs()),
        format!("     {:.3} rad {aside}", left.abs()),
        format!("knee {l_knee:+.3} {r_knee:+.3} m"),
        format!("hip  {l_hip:+.3} {r_hip:+.3} rad"),
        format!("abd. {l_abd:+.3} {r_abd:+.3} rad"),
    ]
}

/// The trunk from above: up is forward, left is left, the rim is 0.2 rad.
fn bubble(telemetry: &Telemetry, height: usize) -> Vec<String> {
    let width = 2 * height + 1;
    let [forward, left] = telemetry.lean.map(|lean| (lean.to_f32() / RIM).clamp(-1.0, 1.0));
    let place = |share: f32, cells: usize| ((0.5 - 0.5 * share) * (cells - 1) as f32).round() as usize;
    let (at_row, at_column) = (place(forward, height), place(left, width));
    let cell = |row: usize, column: usize| match (row == height / 2, column == width / 2) {
        _ if (row, column) == (at_row, at_column) => '●',
        (true, true) => '┼',
        (true, false) => '─',
        (false, true) => '│',
        (false, false) => '·',
    };
    (0..height).map(|row| (0..width).map(|column| cell(row, column)).collect()).collect()
}

#[cfg(test)]
mod tests {
    use sarah_firmware::lpg::{knee, swing};
    use sarah_protocol::fixed::Q16;

    use super::*;

    #[test]
    fn phases_bear_the_names_of_the_firmware() {
        for known in [knee::Phase::Idle, knee::Phase::Kick, knee::Phase::Retract, knee::Phase::Extend] {
            assert_eq!(phase(NodeId::Knee, known as u8), format!("{known:?}").to_lowercase());
        }
        for known in [swing::Phase::Idle, swing::Phase::Ready, swing::Phase::Moving, swing::Phase::Held] {
            assert_eq!(phase(NodeId::Hip, known as u8), format!("{known:?}").to_lowercase());
        }
        assert_eq!(phase(NodeId::Abductor, 9), "phase 9?");
    }

    #[test]
    fn the_bubble_goes_where_the_trunk_leans() {
        let lean = |forward, left| {
            let telemetry = Telemetry { lean: [Q16::lit(forward), Q16::lit(left)], ..Telemetry::default() };
            bubble(&telemetry, 5)
        };
        assert_eq!(lean(0.0, 0.0)[2], "─────●─────");
        assert_eq!(lean(9.0, 0.0)[0], "·····●·····");
        assert_eq!(lean(0.0, 0.2)[2], "●────┼─────");
        assert_eq!(lean(-0.2, -0.2)[4], "·····│····●");
    }
}
