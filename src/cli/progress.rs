//! How far along we are: a bar where standard error is a terminal, plain lines elsewhere.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

/// Plain lines are at least this far apart.
const LINE_INTERVAL: Duration = Duration::from_secs(5);

/// A task of `total` steps.
pub struct Progress {
    label: String,
    total: u64,
    bar: Option<ProgressBar>,
    last_line: Instant,
}

impl Progress {
    pub fn start(label: impl Into<String>, total: u64) -> Self {
        let label = label.into();
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(total);
            if let Ok(style) = ProgressStyle::with_template("{msg} [{bar:30}] {percent:>3} % {elapsed}, {eta} left") {
                bar.set_style(style.progress_chars("=> "));
            }
            bar.set_message(label.clone());
            bar
        });
        Self { label, total, bar, last_line: Instant::now() }
    }

    /// `done` steps are behind us.
    pub fn set(&mut self, done: u64) {
        match &self.bar {
            Some(bar) => bar.set_position(done),
            None if self.last_line.elapsed() >= LINE_INTERVAL && done < self.total => {
                self.last_line = Instant::now();
                note(&format!("{}: {} %", self.label, 100 * done / self.total.max(1)));
            }
            None => {}
        }
    }
}

impl Progress {
    /// A line on standard error, above the bar.
    pub fn note(&self, text: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| note(text)),
            None => note(text),
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// A line on standard error.
pub fn note(text: &str) {
    eprintln!("welkin: {text}");
}
