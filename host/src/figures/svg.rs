//! A sheet to draw on: the few SVG elements that the figures need.

use super::Figure;
use super::theme::{INK, PAPER};
use std::fmt::Write;

/// Where text is anchored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// How text looks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Text {
    pub size: f64,
    pub color: &'static str,
    pub anchor: Anchor,
    pub bold: bool,
    /// Turned upwards, for the titles of vertical axes.
    pub upright: bool,
}

impl Text {
    pub(super) fn new(size: f64) -> Self {
        Self { size, color: INK, anchor: Anchor::Start, bold: false, upright: false }
    }
    pub(super) fn color(self, color: &'static str) -> Self {
        Self { color, ..self }
    }
    pub(super) fn anchor(self, anchor: Anchor) -> Self {
        Self { anchor, ..self }
    }
    pub(super) fn bold(self) -> Self {
        Self { bold: true, ..self }
    }
    pub(super) fn upright(self) -> Self {
        Self { upright: true, ..self }
    }
}

/// How a line looks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stroke {
    pub color: &'static str,
    pub width: f64,
    pub opacity: f64,
    pub dash: Option<&'static str>,
}

impl Stroke {
    pub(super) fn new(color: &'static str, width: f64) -> Self {
        Self { color, width, opacity: 1.0, dash: None }
    }
    pub(super) fn opacity(self, opacity: f64) -> Self {
        Self { opacity, ..self }
    }
    pub(super) fn dash(self, dash: &'static str) -> Self {
        Self { dash: Some(dash), ..self }
    }
    fn attributes(self) -> String {
        let mut text = format!("stroke=\"{}\" stroke-width=\"{}\"", self.color, coordinate(self.width));
        if self.opacity < 1.0 {
            let _ = write!(text, " stroke-opacity=\"{}\"", coordinate(self.opacity));
        }
        if let Some(dash) = self.dash {
            let _ = write!(text, " stroke-dasharray=\"{dash}\"");
        }
        text
    }
}

/// A sheet of paper.
#[derive(Debug)]
pub(super) struct Sheet {
    pub width: f64,
    pub height: f64,
    body: String,
}

impl Sheet {
    pub(super) fn new(width: f64, height: f64) -> Self {
        let mut sheet = Self { width, height, body: String::new() };
        sheet.rect([0.0, 0.0], [width, height], PAPER, 1.0);
        sheet
    }

    pub(super) fn finish(self) -> Figure {
        let (w, h) = (coordinate(self.width), coordinate(self.height));
        Figure {
            svg: format!(
                "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" \
                 font-family=\"Noto Sans, Helvetica, Arial, sans-serif\">\n{}</svg>\n",
                self.body
            ),
        }
    }

    pub(super) fn rect(&mut self, [x, y]: [f64; 2], [w, h]: [f64; 2], fill: &str, opacity: f64) {
        let [x, y, w, h, opacity] = [x, y, w, h, opacity].map(coordinate);
        let _ = writeln!(
            self.body,
            "<rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" fill=\"{fill}\" fill-opacity=\"{opacity}\"/>"
        );
    }

    pub(super) fn line(&mut self, from: [f64; 2], to: [f64; 2], stroke: Stroke) {
        self.polyline(&[from, to], stroke);
    }

    /// A line through points; a point that is not finite leaves a gap.
    pub(super) fn polyline(&mut self, points: &[[f64; 2]], stroke: Stroke) {
        for part in points.split(|point| !point.iter().all(|value| value.is_finite())) {
            if part.len() > 1 {
                let _ = writeln!(
                    self.body,
                    "<polyline points=\"{}\" fill=\"none\" stroke-linejoin=\"round\" stroke-linecap=\"round\" {}/>",
                    path(part),
                    stroke.attributes()
                );
            }
        }
    }

    pub(super) fn polygon(&mut self, points: &[[f64; 2]], fill: &str, opacity: f64, outline: Option<Stroke>) {
        if points.len() > 2 && points.iter().flatten().all(|value| value.is_finite()) {
            let outline = outline.map(|outline| format!(" stroke-linejoin=\"round\" {}", outline.attributes()));
            let _ = writeln!(
                self.body,
                "<polygon points=\"{}\" fill=\"{fill}\" fill-opacity=\"{}\"{}/>",
                path(points),
                coordinate(opacity),
                outline.unwrap_or_default()
            );
        }
    }

    pub(super) fn circle(&mut self, [x, y]: [f64; 2], radius: f64, fill: &str, outline: Option<Stroke>) {
        let [x, y, r] = [x, y, radius].map(coordinate);
        let outline = outline.map(|outline| format!(" {}", outline.attributes())).unwrap_or_default();
        let _ = writeln!(self.body, "<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\" fill=\"{fill}\"{outline}/>");
    }

    pub(super) fn ellipse(&mut self, [x, y]: [f64; 2], [rx, ry]: [f64; 2], fill: &str, opacity: f64) {
        let [x, y, rx, ry, opacity] = [x, y, rx, ry, opacity].map(coordinate);
        let _ = writeln!(
            self.body,
            "<ellipse cx=\"{x}\" cy=\"{y}\" rx=\"{rx}\" ry=\"{ry}\" fill=\"{fill}\" fill-opacity=\"{opacity}\"/>"
        );
    }

    /// An arrow whose point is at `to`.
    pub(super) fn arrow(&mut self, from: [f64; 2], to: [f64; 2], stroke: Stroke) {
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let length = dx.hypot(dy);
        if length < 1e-6 || !length.is_finite() {
            return;
        }
        let (ux, uy) = (dx / length, dy / length);
        let head = (3.4 * stroke.width).min(length);
        let base = [to[0] - ux * head, to[1] - uy * head];
        let half = 0.5 * head;
        self.line(from, [base[0] + ux, base[1] + uy], stroke);
        let wings = [to, [base[0] - uy * half, base[1] + ux * half], [base[0] + uy * half, base[1] - ux * half]];
        self.polygon(&wings, stroke.color, stroke.opacity, None);
    }

    pub(super) fn text(&mut self, [x, y]: [f64; 2], content: &str, style: Text) {
        let anchor = match style.anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let [x, y] = [x, y].map(coordinate);
        let turn = if style.upright { format!(" transform=\"rotate(-90 {x} {y})\"") } else { String::new() };
        let weight = if style.bold { " font-weight=\"bold\"" } else { "" };
        let content = content.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
        let _ = writeln!(
            self.body,
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{}\" fill=\"{}\" text-anchor=\"{anchor}\"{weight}{turn}>{content}</text>",
            style.size, style.color
        );
    }

    /// A row of labels with colour swatches; returns where it ends.
    pub(super) fn legend<'a>(
        &mut self,
        [mut x, y]: [f64; 2],
        entries: impl IntoIterator<Item = (&'a str, Stroke)>,
    ) -> f64 {
        for (label, stroke) in entries {
            self.line([x, y - 4.0], [x + 20.0, y - 4.0], stroke);
            self.text([x + 26.0, y], label, Text::new(super::theme::SMALL));
            x += 26.0 + width_of(label, super::theme::SMALL) + 22.0;
        }
        x
    }
}

/// About how wide a text is, px: enough to place what comes after it.
pub(super) fn width_of(text: &str, size: f64) -> f64 {
    let units: f64 = text
        .chars()
        .map(|letter| match letter {
            'i' | 'l' | 'j' | '.' | ',' | '\'' | '|' | ' ' | '(' | ')' => 0.3,
            'm' | 'w' | 'M' | 'W' | '%' | '–' | '→' => 0.9,
            letter if letter.is_uppercase() => 0.67,
            _ => 0.57,
        })
        .sum();
    units * size
}

/// How much wider bold text is.
pub(super) const BOLD: f64 = 1.08;

fn path(points: &[[f64; 2]]) -> String {
    let points: Vec<String> = points.iter().map(|[x, y]| format!("{},{}", coordinate(*x), coordinate(*y))).collect();
    points.join(" ")
}

/// Two decimals are a hundredth of a pixel, and keep files small.
fn coordinate(value: f64) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}
