//! Progress with time left: a bar in a terminal, a line now and then elsewhere.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

/// Between two lines where there is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(20);

/// Counts episodes towards a known total.
pub struct Progress {
    bar: ProgressBar,
    began: Instant,
    line: Mutex<Instant>,
    unit: &'static str,
}

impl Progress {
    /// Nothing done of `total` episodes.
    pub fn new(total: u64) -> Progress {
        Progress::counting(total, "episodes")
    }

    /// Nothing done of `total` of something else.
    pub fn counting(total: u64, unit: &'static str) -> Progress {
        let style = ProgressStyle::with_template(&format!(
            "{{bar:30.cyan/blue}} {{pos}}/{{len}} {unit}  {{elapsed}} gone, {{eta}} left  {{msg}}"
        ));
        let bar = ProgressBar::new(total);
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.enable_steady_tick(Duration::from_millis(500));
        Progress { bar, began: Instant::now(), line: Mutex::new(Instant::now()), unit }
    }

    /// A phase begins.
    pub fn phase(&self, text: &str) {
        self.bar.set_message(text.to_owned());
        self.print(&format!("{text} ({:.0} s)", self.began.elapsed().as_secs_f32()));
    }

    /// Episodes done before this process began: they count, but say nothing about the time left.
    pub fn skip(&self, episodes: u64) {
        self.bar.inc(episodes);
        self.bar.reset_eta();
    }

    /// One more episode; `what` is shown.
    pub fn episode(&self, what: Option<String>) {
        self.bar.inc(1);
        if let Some(what) = what {
            self.bar.set_message(what);
        }
        let mut line = self.line.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if self.bar.is_hidden() && line.elapsed() > LINE_EVERY {
            *line = Instant::now();
            let (done, total) = (self.bar.position(), self.bar.length().unwrap_or(0));
            let left = self.began.elapsed().as_secs_f32() / done.max(1) as f32 * total.saturating_sub(done) as f32;
            eprintln!("{done}/{total} {}, about {left:.0} s left: {}", self.unit, self.bar.message());
        }
    }

    /// A line that stays.
    pub fn print(&self, text: &str) {
        if self.bar.is_hidden() {
            eprintln!("{text}");
        } else {
            self.bar.println(text);
        }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
