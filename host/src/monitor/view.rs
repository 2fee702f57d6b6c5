//! The screen: header, what needs attention, panels in one or two columns, and a line for keys and messages.
//!
//! Every panel is a function from the dashboard and a size to lines of text. A column gives its panels the rows they
//! need at least, in the order of their importance, then what they would like; what does not fit is left out whole.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Clear, Paragraph};

use super::attention::Level;
use super::panels::{self, Panel};
use super::state::Dashboard;
use super::text::wrap;
use crate::link::live::Role;

/// From this width on there are two columns.
const TWO_COLUMNS: u16 = 72;
/// The left column is no wider than this; parameters and log profit from the rest.
const LEFT: (u16, u16) = (38, 44);

/// How a level looks. The words say the same without colour.
pub(super) fn style(level: Level) -> Style {
    match level {
        Level::Calm => Style::new(),
        Level::Notice => Style::new().fg(Color::Yellow),
        Level::Alarm => Style::new().fg(Color::Red).add_modifier(Modifier::BOLD),
    }
}

pub(super) const DIM: Style = Style::new().add_modifier(Modifier::DIM);
pub(super) const BOLD: Style = Style::new().add_modifier(Modifier::BOLD);

impl Dashboard {
    /// Draws everything, at this moment of the link's clock.
    pub fn view(&self, frame: &mut Frame<'_>, now_us: u64) {
        let area = frame.area();
        let attention = self.attention_lines(now_us, area.width, area.height);
        let mut rest = area;
        self.header(frame, take(&mut rest, 1), now_us);
        let footer = take_last(&mut rest, 1);
        frame.render_widget(Paragraph::new(self.footer(now_us)), footer);
        let rows = u16::try_from(attention.len()).unwrap_or(u16::MAX);
        frame.render_widget(Paragraph::new(attention), take(&mut rest, rows));
        if self.help {
            frame.render_widget(Clear, rest);
            frame.render_widget(Paragraph::new(panels::help::lines(self.role)), rest);
            return;
        }
        if rest.width < TWO_COLUMNS {
            return self.column(frame, rest, now_us, &panels::ALL);
        }
        let left = take_left(&mut rest, (area.width * 2 / 5).clamp(LEFT.0, LEFT.1));
        take_left(&mut rest, 1);
        let (on_the_left, on_the_right) = panels::columns(rest.height);
        self.column(frame, left, now_us, on_the_left);
        self.column(frame, rest, now_us, on_the_right);
    }

    fn header(&self, frame: &mut Frame<'_>, area: Rect, now_us: u64) {
        let (level, headline) = self.headline(now_us);
        let style = match level {
            Level::Calm => Style::new().fg(Color::Green).add_modifier(Modifier::BOLD),
            level => style(level).add_modifier(Modifier::BOLD),
        };
        let left = Line::from(vec![Span::styled(" S.A.R.A.H.  ", BOLD), Span::styled(headline, style)]);
        let port = self.health.as_ref().map_or("", |health| health.port.as_str());
        let role = if self.role == Role::Observer { "watching  " } else { "" };
        let right = format!("{role}{port}  {:.0} frames/s ", self.trend.frames_per_s(now_us));
        // The state matters more than the port.
        let room = usize::from(area.width).saturating_sub(left.width() + 2);
        frame.render_widget(Paragraph::new(left), area);
        if right.chars().count() <= room {
            frame.render_widget(Paragraph::new(Line::styled(right, DIM).right_aligned()), area);
        }
    }

    fn attention_lines(&self, now_us: u64, width: u16, height: u16) -> Vec<Line<'static>> {
        let width = usize::from(width.saturating_sub(3));
        let mut lines = vec![];
        for (level, advice) in self.attention(now_us) {
            let mark = match level {
                Level::Calm => "  ",
                Level::Notice => " · ",
                Level::Alarm => " ! ",
            };
            let text = match advice.remedy.is_empty() {
                true => advice.what,
                false => format!("{}: {}", advice.what, advice.remedy),
            };
            for (index, line) in wrap(&text, width).into_iter().enumerate() {
                lines.push(Line::styled(format!("{}{line}", if index == 0 { mark } else { "   " }), style(level)));
            }
        }
        // The most pressing stands first; the rest must leave room to see the robot.
        lines.truncate(usize::from(height / 3).max(1));
        lines
    }

    fn footer(&self, now_us: u64) -> Line<'static> {
        if self.asking(now_us) {
            let question = " arm? The robot may step at once. y/n ";
            return Line::styled(question, Style::new().fg(Color::Yellow).add_modifier(Modifier::REVERSED));
        }
        if let Some(note) = self.note(now_us) {
            return Line::styled(format!(" {note}"), BOLD);
        }
        let keys = match self.role {
            Role::Writer => " a arm   space stop   d disarm   c clear stop   ? help   q quit",
            Role::Observer => " space stop   ? help   q quit",
        };
        Line::styled(keys, DIM)
    }

    fn column(&self, frame: &mut Frame<'_>, mut area: Rect, now_us: u64, panels: &[Panel]) {
        let rows = share(area.height, panels);
        for (panel, rows) in panels.iter().zip(rows).filter(|(_, rows)| *rows > 0) {
            frame.render_widget(Paragraph::new(title(panel.title, area.width)), take(&mut area, 1));
            let mut lines = (panel.lines)(self, now_us, usize::from(area.width), usize::from(rows - 1));
            if panel.live && self.fresh(now_us).is_none() {
                // What is old must not look as if it were true now.
                lines = lines.into_iter().map(|line| line.patch_style(DIM)).collect();
            }
            lines.truncate(usize::from(rows - 1));
            frame.render_widget(Paragraph::new(lines), take(&mut area, rows - 1));
        }
    }
}

/// Rows of every panel, its title included; 0 for one that has no room.
fn share(height: u16, panels: &[Panel]) -> Vec<u16> {
    let mut rows = vec![0; panels.len()];
    let mut left = height;
    let mut order: Vec<usize> = (0..panels.len()).collect();
    order.sort_by_key(|index| panels[*index].rank);
    for index in &order {
        let least = panels[*index].rows.0 + 1;
        if least <= left {
            rows[*index] = least;
            left -= least;
        }
    }
    for index in order {
        if rows[index] > 0 {
            let more = (panels[index].rows.1 + 1).saturating_sub(rows[index]).min(left);
            rows[index] += more;
            left -= more;
        }
    }
    rows
}

fn title(text: &str, width: u16) -> Line<'static> {
    let rule = "─".repeat(usize::from(width).saturating_sub(text.chars().count() + 3));
    Line::from(vec![
        Span::styled("─ ", DIM),
        Span::styled(text.to_owned(), BOLD),
        Span::styled(format!(" {rule}"), DIM),
    ])
}

fn take(area: &mut Rect, rows: u16) -> Rect {
    let rows = rows.min(area.height);
    let taken = Rect { height: rows, ..*area };
    area.y += rows;
    area.height -= rows;
    taken
}

fn take_last(area: &mut Rect, rows: u16) -> Rect {
    let rows = rows.min(area.height);
    area.height -= rows;
    Rect { y: area.y + area.height, height: rows, ..*area }
}

fn take_left(area: &mut Rect, columns: u16) -> Rect {
    let columns = columns.min(area.width);
    let taken = Rect { width: columns, ..*area };
    area.x += columns;
    area.width -= columns;
    taken
}
