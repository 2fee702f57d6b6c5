//! One look for all figures: light paper, dark ink, colours that colour-blind readers can tell apart.

/// Paper.
pub const PAPER: &str = "#ffffff";
/// Text and main lines.
pub const INK: &str = "#1f2933";
/// Secondary text.
pub const MUTED: &str = "#5f6b7a";
/// Axis lines and ticks.
pub const AXIS: &str = "#9aa5b1";
/// Grid lines.
pub const GRID: &str = "#e8ecf0";
/// Shaded spans.
pub const SPAN: &str = "#f3f5f7";

/// Series colours (Okabe and Ito, 2008): blue, vermilion, green, purple, orange, sky.
pub const SERIES: [&str; 6] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];

/// The push.
pub const PUSH: &str = "#d55e00";

/// The colour of the `index`-th series.
pub fn series(index: usize) -> &'static str {
    SERIES[index % SERIES.len()]
}

/// Size of tick labels, px.
pub const SMALL: f64 = 12.0;
/// Size of axis titles and labels, px.
pub const NORMAL: f64 = 13.0;
/// Size of panel titles, px.
pub const LARGE: f64 = 15.0;
