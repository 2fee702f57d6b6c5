//! Link, energy and log.

use ratatui::text::Line;
use sarah_protocol::bus::NodeId;
use sarah_protocol::session::State;

use super::super::attention::Level;
use super::super::state::Dashboard;
use super::super::text::{cut, duration};
use super::super::view::{DIM, style};
use super::super::words::{node, reset_words};
use crate::link::live::Role;

pub(super) fn link(dashboard: &Dashboard, now_us: u64, _: usize, _: usize) -> Vec<Line<'static>> {
    let Some(health) = &dashboard.health else { return vec![Line::styled(" not opened yet", DIM)] };
    let stats = &health.stats;
    let state = match (health.up, health.state) {
        (false, _) => "down, tried again",
        (true, State::Greeting) => "up, waits for hello",
        (true, State::Claiming) => "up, asks to write",
        (true, State::Open) if dashboard.role == Role::Observer => "up, watches",
        (true, State::Open) => "up, writes",
        (true, State::Failed(_)) => "up, firmware does not fit",
    };
    let heard = match dashboard.telemetry {
        Some(_) => format!("{} old", duration(dashboard.age_us(now_us))),
        None => "none yet".into(),
    };
    let ms = |us: u32| f64::from(us) / 1000.0;
    let level = if health.up { Level::Calm } else { Level::Alarm };
    let dropped = dashboard.telemetry.map_or(0, |(_, telemetry)| telemetry.dropped);
    let mut lines = vec![
        Line::styled(format!(" {} {state}", health.port), style(level)),
        Line::raw(format!(
            " {:.0} frames/s, {heard}, trip {:.0} ms",
            dashboard.trend.frames_per_s(now_us),
            ms(stats.round_trip_us)
        )),
        Line::raw(format!(" lost {}, CRC errors {}, retries {}", stats.lost, stats.frame_errors, stats.retries)),
        Line::raw(format!(" dropped there {dropped}, reconnects {}, unknown {}", health.reconnects, stats.undecodable)),
        Line::raw(format!(" worst trip {:.1} ms, frames {}", ms(stats.worst_round_trip_us), stats.frames)),
    ];
    if let Some(robot) = &dashboard.robot {
        let build: String = robot.build.iter().take_while(|byte| **byte != 0).map(|byte| printable(*byte)).collect();
        let heard = NodeId::ALL.into_iter().filter(|id| robot.nodes & 1 << *id as u8 != 0).map(node);
        let heard: Vec<&str> = heard.collect();
        let board = match robot.board {
            0 => "simulated".into(),
            board => format!("board {board}, build {build}"),
        };
        let reset = dashboard.telemetry.map_or("?", |(_, telemetry)| reset_words(telemetry.reset_cause).0);
        lines.push(Line::raw(format!(" {board}, hears {}; reset: {reset}", heard.join(" "))));
    }
    lines
}

/// What a stranger sends must not steer the terminal.
fn printable(byte: u8) -> char {
    if byte.is_ascii_graphic() || byte == b' ' { byte.into() } else { '?' }
}

pub(super) fn energy(dashboard: &Dashboard, _: u64, _: usize, rows: usize) -> Vec<Line<'static>> {
    let energy = &dashboard.energy;
    let (actuators_w, compute_w) = (energy.actuators_w, energy.compute_w());
    let moving = format!("{} of 6 move", energy.moving);
    if rows < 3 {
        return vec![Line::raw(format!(" {actuators_w:.1} W actuators, {compute_w:.0} W computers"))];
    }
    let hours = match energy.actuators_h() {
        // A standing robot's actuators draw nothing.
        hours if hours > 1000.0 => "long".into(),
        hours => format!("{hours:.1} h"),
    };
    vec![
        Line::raw(format!(" {actuators_w:.1} W actuators over 10 s, {moving}")),
        Line::raw(format!(" {compute_w:.0} W computers; {:.0} J actuators so far", energy.actuators_j)),
        Line::raw(format!(" full batteries: 36 V {hours}, 12 V {:.1} h", energy.compute_h())),
    ]
}

pub(super) fn log(dashboard: &Dashboard, _: u64, width: usize, rows: usize) -> Vec<Line<'static>> {
    let entries = dashboard.log.newest(rows);
    let lines = entries.map(|entry| {
        let times = if entry.times > 1 { format!(" ×{}", entry.times) } else { String::new() };
        let line = format!(" {:>6.1} {}{times}", entry.at_us as f64 * 1e-6, entry.text);
        cut(&line, width)
    });
    lines.map(Line::raw).collect()
}
