//! The panels, each a function from the dashboard and a size to lines.

mod body;
pub(super) mod help;
mod parameters;
mod system;

use ratatui::text::Line;

use super::state::Dashboard;

/// From the dashboard, the time of the link's clock in µs, width and rows to lines.
type Lines = fn(&Dashboard, u64, usize, usize) -> Vec<Line<'static>>;

/// A part of the screen.
#[derive(Clone, Copy)]
pub(super) struct Panel {
    /// What stands in its rule.
    pub title: &'static str,
    /// Rows it needs at least, and rows it can use.
    pub rows: (u16, u16),
    /// The lower, the earlier it gets its rows.
    pub rank: u8,
    /// It shows telemetry, which is worth nothing when it is old.
    pub live: bool,
    /// What stands in it.
    pub lines: Lines,
}

const GAIT: Panel = Panel { title: "gait", rows: (6, 13), rank: 0, live: true, lines: body::gait };
const FEET: Panel =
    Panel { title: "feet: heel, toe, both; ┊ is 15 N", rows: (2, 4), rank: 1, live: true, lines: body::feet };
const POSTURE: Panel = Panel { title: "posture", rows: (5, 9), rank: 2, live: true, lines: body::posture };
const PARAMETERS: Panel = Panel { title: "parameters", rows: (14, 16), rank: 3, live: false, lines: parameters::lines };
const LINK: Panel = Panel { title: "link", rows: (2, 6), rank: 4, live: false, lines: system::link };
const EVENTS: Panel = Panel { title: "log", rows: (2, 200), rank: 6, live: false, lines: system::log };
const ENERGY: Panel = Panel { title: "energy, estimated", rows: (1, 3), rank: 5, live: true, lines: system::energy };

/// The left of two columns, and the right: the log stands where there is room for long lines.
pub(super) fn columns(height: u16) -> (&'static [Panel], &'static [Panel]) {
    match height >= TALL {
        true => (&[GAIT, FEET, POSTURE, ENERGY], &[PARAMETERS, LINK, EVENTS]),
        false => (&[GAIT, FEET, POSTURE, ENERGY, EVENTS], &[PARAMETERS, LINK]),
    }
}

/// From this height on the log fits below parameters and link.
const TALL: u16 = PARAMETERS.rows.1 + LINK.rows.1 + 3 + 4;

/// One column.
pub(super) const ALL: [Panel; 7] = [GAIT, FEET, POSTURE, PARAMETERS, LINK, ENERGY, EVENTS];
