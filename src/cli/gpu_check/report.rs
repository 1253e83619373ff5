//! What has been measured so far, as JSON and as a page of Markdown.

use std::collections::BTreeMap;
use std::fmt::Write;

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Results of a device. Written anew after each measurement.
#[derive(Serialize, Default)]
pub struct Report {
    /// Version of the keys.
    pub format: u32,
    pub device: Device,
    pub welkin: String,
    /// Seconds since 1970 when the run began.
    pub started: u64,
    pub scale: String,
    pub budget_seconds: u64,
    pub seconds: f64,
    pub host_cores: usize,
    pub steps: Vec<Step>,
    pub figures: BTreeMap<String, Figure>,
    pub passes: Vec<Passes>,
    pub checks: Vec<Checks>,
    pub targets: Vec<Target>,
    pub previous: Option<Previous>,
}

#[derive(Serialize, Deserialize, Default, Clone, PartialEq, Debug)]
pub struct Device {
    pub name: String,
    /// `discrete`, `integrated`, `virtual`, `cpu` or `other`.
    pub kind: String,
    pub driver: String,
    pub api: String,
}

impl Device {
    /// Name of its files: device and driver in small letters and digits, dashes between.
    pub fn slug(&self) -> String {
        let text = format!("{} {}", self.name, self.driver).to_lowercase();
        let words: Vec<&str> =
            text.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty()).collect();
        if words.is_empty() { "unknown-device".into() } else { words.join("-") }
    }

    /// Whether speeds are a CPU's, which no goal is meant for.
    pub fn is_cpu(&self) -> bool {
        self.kind == "cpu"
    }
}

#[derive(Serialize)]
pub struct Step {
    pub name: &'static str,
    pub about: &'static str,
    pub limit_seconds: f64,
    pub seconds: f64,
    pub tasks: Vec<Task>,
}

#[derive(Serialize)]
pub struct Task {
    pub name: String,
    /// `done`, `failed` (it says so itself), `error`, `cut` (its time was up) or `left out`.
    pub result: &'static str,
    /// Why not `done`.
    pub reason: Option<String>,
    pub seconds: f64,
    pub host_peak_bytes: Option<u64>,
}

#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
pub struct Figure {
    pub value: f64,
    pub unit: String,
}

/// Times of one mode in one setting.
#[derive(Serialize)]
pub struct Passes {
    pub width: u64,
    pub height: u64,
    pub preset: String,
    pub mode: String,
    /// Median and 95th percentile of each pass [ms], as `bench` gives them.
    pub passes: Value,
}

/// A run of `conform`.
#[derive(Serialize)]
pub struct Checks {
    pub name: String,
    pub passed: u64,
    pub failed: u64,
    pub skipped: u64,
    /// Id, and what was found, of each row that failed.
    pub failures: Vec<(String, String)>,
}

/// A number to reach on a data-centre GPU.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Target {
    pub what: String,
    pub figure: String,
    pub goal: f64,
    /// `at most` or `at least`.
    pub sense: &'static str,
    pub unit: &'static str,
    pub value: Option<f64>,
    /// `met`, `missed`, `not measured` or `not applicable` (a CPU driver).
    pub verdict: &'static str,
}

/// An earlier run on the same device and driver.
#[derive(Serialize)]
pub struct Previous {
    pub started: u64,
    pub figures: Vec<Change>,
}

#[derive(Serialize, PartialEq, Debug)]
pub struct Change {
    pub figure: String,
    pub before: f64,
    pub now: f64,
    /// now / before
    pub ratio: f64,
}

/// What is read back of a report.
#[derive(Deserialize)]
pub struct Earlier {
    started: u64,
    scale: String,
    figures: BTreeMap<String, Figure>,
}

/// Best published sort of pairs [pairs/s]: Adinets and Merrill, *Onesweep* (arXiv:2206.01784, 2022) sort 29.4e9 random 32-bit
/// keys a second on an A100 (2²⁸ of them). They publish keys alone; a pass over a pair moves 16 bytes instead of 8, with one
/// more reading of the keys for the histograms: 4·8 + 4 = 36 bytes a key, 4·16 + 4 = 68 a pair.
pub const PUBLISHED_PAIRS_PER_SECOND: f64 = 29.4e9 * 36.0 / 68.0;

/// Goal, sense, unit, figure and what it is.
const TARGETS: [(f64, &str, &str, &str, &str); 7] = [
    (2.0, "at most", "ms", "bench/1920x1080/high/interlock/frame", "frame, 1080p, high, first goal"),
    (1.0, "at most", "ms", "bench/1920x1080/high/interlock/frame", "frame, 1080p, high, then"),
    (1.25, "at most", "1", "bench/1920x1080/high/interlock/over alpha", "interlock over alpha, frame"),
    (1.0, "at most", "1", "bench/1920x1080/high/tiled/over alpha", "tiled over alpha, frame"),
    (0.2, "at most", "s", "tables/full/scattering", "scattering tables, cold"),
    (5.0, "at most", "ms", "tables/full/optical depth", "optical depth table, cold"),
    (
        PUBLISHED_PAIRS_PER_SECOND / 1.5,
        "at least",
        "pairs/s",
        "sort/10000000",
        "sort within 1.5 times of the best published",
    ),
];

impl Report {
    pub fn figure(&mut self, name: impl Into<String>, value: Option<f64>, unit: &str) {
        if let Some(value) = value.filter(|value| value.is_finite()) {
            self.figures.insert(name.into(), Figure { value, unit: unit.into() });
        }
    }

    /// Brings what is drawn from the figures up to date.
    pub fn settle(&mut self, earlier: Option<&Earlier>) {
        let verdict = |goal: f64, sense: &str, value: Option<f64>| match value {
            _ if self.device.is_cpu() => "not applicable",
            None => "not measured",
            Some(value) if (sense == "at most" && value <= goal) || (sense == "at least" && value >= goal) => "met",
            Some(_) => "missed",
        };
        let target = |&(goal, sense, unit, figure, what): &(f64, &'static str, &'static str, &str, &str)| {
            let value = self.figures.get(figure).map(|figure| figure.value);
            Target {
                what: what.into(),
                figure: figure.into(),
                goal,
                sense,
                unit,
                value,
                verdict: verdict(goal, sense, value),
            }
        };
        self.targets = TARGETS.iter().map(target).collect();
        // Sizes differ between scales, so only equal ones are compared.
        self.previous = earlier.filter(|earlier| earlier.scale == self.scale).map(|earlier| Previous {
            started: earlier.started,
            figures: self
                .figures
                .iter()
                .filter_map(|(name, figure)| {
                    let before = earlier.figures.get(name).filter(|before| before.unit == figure.unit)?.value;
                    let ratio = figure.value / before;
                    ratio.is_finite().then(|| Change { figure: name.clone(), before, now: figure.value, ratio })
                })
                .collect(),
        });
    }

    pub fn markdown(&self) -> String {
        let Device { name, kind, driver, api } = &self.device;
        let title = if name.is_empty() { "A device that was not reached" } else { name };
        let mut text = format!("# {title}\n\n{driver}, {kind}, Vulkan {api}; host with {} cores. ", self.host_cores);
        // Writing to a string cannot fail, here and below.
        let _ = writeln!(
            text,
            "Welkin {}, {} (UTC), scale `{}`, {:.0} s of {} s. Written by `scripts/gpu-check`; \
             [README.md](README.md) explains it.",
            self.welkin,
            date(self.started),
            self.scale,
            self.seconds,
            self.budget_seconds
        );
        if self.device.is_cpu() {
            text.push_str("\n**This is a driver for the CPU: nothing here tells the speed of a GPU.**\n");
        }
        text.push_str("\n## Goals\n| what | goal | measured | |\n|---|---|---|---|\n");
        for Target { what, goal, sense, unit, value, verdict, .. } in &self.targets {
            let value = value.map_or("–".into(), |value| number(value, unit));
            let _ = writeln!(text, "| {what} | {sense} {} | {value} | {verdict} |", number(*goal, unit));
        }
        text.push_str("\n## Steps\n| step | time | limit | |\n|---|---|---|---|\n");
        for step in &self.steps {
            let of = |result: &str| step.tasks.iter().filter(|task| task.result == result).count();
            let counts: Vec<String> = ["done", "failed", "error", "cut", "left out"]
                .iter()
                .filter(|result| of(result) > 0)
                .map(|result| format!("{} {result}", of(result)))
                .collect();
            let _ = writeln!(
                text,
                "| {}: {} | {:.1} s | {:.0} s | {} |",
                step.name,
                step.about,
                step.seconds,
                step.limit_seconds,
                counts.join(", ")
            );
        }
        for (step, task) in self.steps.iter().flat_map(|step| step.tasks.iter().map(move |task| (step, task))) {
            if let Some(reason) = &task.reason {
                let _ = writeln!(text, "\n- {}, {}, {}: {}", step.name, task.name, task.result, one_line(reason));
            }
        }
        self.frames(&mut text);
        if !self.checks.is_empty() {
            text.push_str("\n## Conformance\n| run | passed | failed | skipped |\n|---|---|---|---|\n");
        }
        for Checks { name, passed, failed, skipped, .. } in &self.checks {
            let _ = writeln!(text, "| {name} | {passed} | {failed} | {skipped} |");
        }
        for checks in &self.checks {
            for (id, found) in &checks.failures {
                let _ = writeln!(text, "\n- {}, **{id}**: {}", checks.name, one_line(found));
            }
        }
        text.push_str("\n## Other figures\n| figure | value |\n|---|---|\n");
        for (name, figure) in self.figures.iter().filter(|(name, _)| !name.starts_with("bench/")) {
            let _ = writeln!(text, "| {name} | {} |", number(figure.value, &figure.unit));
        }
        if let Some(previous) = &self.previous {
            let _ = writeln!(text, "\n## Since {} (UTC)\n| figure | before | now | ratio |", date(previous.started));
            text.push_str("|---|---|---|---|\n");
            for Change { figure, before, now, ratio } in &previous.figures {
                let _ = writeln!(text, "| {figure} | {before:.4} | {now:.4} | {ratio:.3} |");
            }
        }
        text
    }

    /// Frame times: a row for each size and preset, a column for each mode.
    fn frames(&self, text: &mut String) {
        let named: Vec<(Vec<&str>, f64)> = self
            .figures
            .iter()
            .filter(|(name, _)| name.starts_with("bench/"))
            .map(|(name, figure)| (name.split('/').collect(), figure.value))
            .collect();
        let mut modes: Vec<&str> = Vec::new();
        let mut settings: Vec<(&str, &str)> = Vec::new();
        for [_, size, preset, mode, _] in
            named.iter().filter_map(|(words, _)| <[&str; 5]>::try_from(words.clone()).ok())
        {
            if !modes.contains(&mode) {
                modes.push(mode);
            }
            if !settings.contains(&(size, preset)) {
                settings.push((size, preset));
            }
        }
        if settings.is_empty() {
            return;
        }
        let pixels = |size: &str| size.split('x').filter_map(|side| side.parse::<u64>().ok()).product::<u64>();
        let rank = |preset: &str| ["low", "medium", "high"].iter().position(|known| *known == preset);
        settings.sort_by_key(|(size, preset)| (pixels(size), rank(preset)));
        text.push_str("\n## Frames of noon\nMedian / 95th percentile on the device \\[ms], modes in turns.\n\n| |");
        for mode in &modes {
            let _ = write!(text, " {mode} |");
        }
        let _ = writeln!(text, "\n|---|{}", "---|".repeat(modes.len()));
        for (size, preset) in settings {
            let _ = write!(text, "| {size}, {preset} |");
            for mode in &modes {
                let of = |what: &str| self.figures.get(&format!("bench/{size}/{preset}/{mode}/{what}"));
                match (of("frame"), of("frame p95")) {
                    (Some(frame), Some(p95)) => {
                        let _ = write!(text, " {:.3} / {:.3} |", frame.value, p95.value);
                    }
                    _ => text.push_str(" – |"),
                }
            }
            text.push('\n');
        }
        text.push_str("\nEach pass of each of them is in the JSON file.\n");
    }
}

fn number(value: f64, unit: &str) -> String {
    match unit {
        "bytes" => format!("{:.0} MiB", value / 1024.0 / 1024.0),
        "1" => format!("{value:.4}"),
        _ if value >= 1e5 => format!("{:.1} million {unit}", value * 1e-6),
        _ => format!("{value:.3} {unit}"),
    }
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Day and time of `seconds` since 1970 (H. Hinnant, days to civil).
fn date(seconds: u64) -> String {
    let (days, rest) = (seconds / 86_400 + 719_468, seconds % 86_400);
    let (era, of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted = (5 * of_year + 2) / 153; // months from March
    let day = of_year - (153 * shifted + 2) / 5 + 1;
    let month = if shifted < 10 { shifted + 3 } else { shifted - 9 };
    let year = year_of_era + era * 400 + u64::from(month <= 2);
    format!("{year}-{month:02}-{day:02} {:02}:{:02}", rest / 3600, rest % 3600 / 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(kind: &str, figures: &[(&str, f64, &str)]) -> Report {
        let device = Device { kind: kind.into(), ..Device::default() };
        let mut report = Report { device, scale: "full".into(), ..Report::default() };
        figures.iter().for_each(|&(name, value, unit)| report.figure(name, Some(value), unit));
        report.settle(None);
        report
    }

    #[test]
    fn goals_are_met_missed_not_measured_or_not_applicable() {
        let figures = [
            ("bench/1920x1080/high/interlock/frame", 1.5, "ms"),
            ("sort/10000000", 1.1e10, "pairs/s"),
            ("tables/full/scattering", 0.3, "s"),
        ];
        let verdicts = |kind: &str| report(kind, &figures).targets.iter().map(|t| t.verdict).collect::<Vec<_>>();
        let (none, cpu) = ("not measured", "not applicable");
        assert_eq!(verdicts("discrete"), ["met", "missed", none, none, "missed", none, "met"]);
        assert_eq!(verdicts("cpu"), [cpu; 7]);
        assert!((PUBLISHED_PAIRS_PER_SECOND * 1e-9 - 15.56).abs() < 0.01);
    }

    #[test]
    fn an_earlier_run_of_equal_scale_is_compared_figure_by_figure() {
        let before = report("discrete", &[("a", 2.0, "ms"), ("b", 0.0, "ms"), ("c", 1.0, "s"), ("d", 1.0, "s")]);
        let text = serde_json::to_string(&before).unwrap();
        let earlier: Earlier = serde_json::from_str(&text).unwrap();
        let mut now = report("discrete", &[("a", 1.0, "ms"), ("b", 1.0, "ms"), ("c", 1.0, "ms"), ("e", 1.0, "s")]);
        now.settle(Some(&earlier));
        // b has no ratio, c another unit, d and e no counterpart.
        let expected = Change { figure: "a".into(), before: 2.0, now: 1.0, ratio: 0.5 };
        assert_eq!(now.previous.as_ref().unwrap().figures, [expected]);
        assert!(now.markdown().contains("| a | 2.0000 | 1.0000 | 0.500 |"));
        now.scale = "tiny".into();
        now.settle(Some(&earlier));
        assert!(now.previous.is_none());
    }

    #[test]
    fn files_are_named_by_device_and_driver() {
        let device =
            Device { name: "NVIDIA H100 80GB HBM3".into(), driver: "NVIDIA 570.1/x".into(), ..Device::default() };
        assert_eq!(device.slug(), "nvidia-h100-80gb-hbm3-nvidia-570-1-x");
        assert_eq!(Device::default().slug(), "unknown-device");
    }

    #[test]
    fn the_page_has_a_row_for_each_setting_and_a_column_for_each_mode() {
        let report = report(
            "discrete",
            &[
                ("bench/64x32/high/alpha/frame", 1.0, "ms"),
                ("bench/64x32/high/alpha/frame p95", 2.0, "ms"),
                ("bench/64x32/low/list/frame", 3.0, "ms"),
                ("bench/64x32/low/list/frame p95", 4.0, "ms"),
            ],
        );
        let page = report.markdown();
        assert!(page.contains("| | alpha | list |"), "{page}");
        assert!(page.contains("| 64x32, low | – | 3.000 / 4.000 |\n| 64x32, high | 1.000 / 2.000 | – |"), "{page}");
    }

    #[test]
    fn dates_are_of_the_gregorian_calendar() {
        assert_eq!(date(0), "1970-01-01 00:00");
        assert_eq!(date(951_782_400 + 3_660), "2000-02-29 01:01");
        assert_eq!(date(1_798_761_599), "2026-12-31 23:59");
    }
}
