//! What came of the checks, as JSON and as a table.

use std::collections::BTreeMap;
use std::fmt::Write;

use serde::{Deserialize, Serialize};
use welkin::conform::{Check, Group, Outcome, Verdict};
use welkin::gpu::Capabilities;

#[derive(Serialize)]
pub struct Report {
    /// `quick` or `full`.
    pub effort: &'static str,
    pub devices: Vec<DeviceReport>,
}

#[derive(Serialize, Default, Debug)]
pub struct DeviceReport {
    /// Number of devices that there are.
    #[serde(skip)]
    pub of: usize,
    /// None if not even this could be found out.
    pub device: Option<Device>,
    /// Why no check could be tried at all.
    pub error: Option<String>,
    pub passed: usize,
    pub failed: usize,
    pub skipped: usize,
    pub rows: Vec<Row>,
}

#[derive(Serialize, Deserialize, Debug)]
pub struct Device {
    pub index: usize,
    pub name: String,
    pub kind: String,
    pub driver: String,
    pub api: String,
    /// Whether the validation layer watched.
    pub validation: bool,
}

impl Device {
    pub fn new(capabilities: &Capabilities, index: usize) -> Self {
        Self {
            index,
            name: capabilities.device_name.clone(),
            kind: capabilities.device_type.to_owned(),
            driver: capabilities.driver.clone(),
            api: capabilities.api.clone(),
            validation: false,
        }
    }
}

#[derive(Serialize, Deserialize, Debug)]
pub struct Row {
    pub id: String,
    pub group: String,
    pub what: String,
    pub why: String,
    pub spec: String,
    /// `pass`, `fail` or `skip`.
    pub result: String,
    /// Of a row that passed: what was tried or measured.
    pub note: Option<String>,
    /// Of a row that failed.
    pub expected: Option<String>,
    pub found: Option<String>,
    /// Of a row that was skipped.
    pub reason: Option<String>,
    pub seconds: f64,
    pub validation_messages: Vec<String>,
}

impl Row {
    pub fn new(check: &Check, outcome: Outcome) -> Self {
        let (result, note, expected, found, reason) = match outcome.verdict {
            Verdict::Pass(note) => ("pass", Some(note), None, None, None),
            Verdict::Fail { expected, found } => ("fail", None, Some(expected), Some(found), None),
            Verdict::Skip(reason) => ("skip", None, None, None, Some(reason)),
        };
        Self {
            id: check.id.clone(),
            group: check.group.name().to_owned(),
            what: check.what.clone(),
            why: check.why.to_owned(),
            spec: check.spec.to_owned(),
            result: result.to_owned(),
            note,
            expected,
            found,
            reason,
            seconds: (outcome.seconds * 1e3).round() / 1e3,
            validation_messages: outcome.validation,
        }
    }

    /// A check in which the process came to an end.
    pub fn broken(check: &Check, found: String) -> Self {
        let verdict = Verdict::fail("an end of the check", found);
        Self::new(check, Outcome { verdict, seconds: 0.0, validation: Vec::new(), device_failed: true })
    }

    pub fn failed(&self) -> bool {
        self.result == "fail"
    }

    /// The row on one line.
    pub fn line(&self) -> String {
        let detail = match (&self.expected, &self.found, &self.reason, &self.note) {
            (Some(expected), Some(found), ..) => format!("expected {expected}; found {found}"),
            (.., Some(reason), _) => reason.clone(),
            (.., Some(note)) => note.clone(),
            _ => String::new(),
        };
        format!("{} {:<44} {detail}", self.result.to_uppercase(), self.id)
    }
}

impl DeviceReport {
    pub fn count(&mut self) {
        let of = |result: &str| self.rows.iter().filter(|row| row.result == result).count();
        (self.passed, self.failed, self.skipped) = (of("pass"), of("fail"), of("skip"));
    }

    /// Whether nothing failed.
    pub fn green(&self) -> bool {
        self.error.is_none() && self.failed == 0
    }
}

impl Report {
    pub fn text(&self) -> String {
        let mut text = String::new();
        for report in &self.devices {
            // Writing to a string cannot fail, here and below.
            if let Some(device) = &report.device {
                let Device { index, name, kind, driver, api, .. } = device;
                let _ = writeln!(text, "{index}: {name} ({kind}, Vulkan {api}, {driver})");
                if !device.validation {
                    let _ = writeln!(text, "   the validation layer is not installed: misuse goes unseen");
                }
            }
            for group in Group::ALL {
                let rows: Vec<_> = report.rows.iter().filter(|row| row.group == group.name()).collect();
                if !rows.is_empty() {
                    let _ = writeln!(text, "\n{}: {}", group.name(), group.about());
                }
                for row in rows {
                    let _ = writeln!(text, "  {}", row.line());
                    for message in &row.validation_messages {
                        let _ = writeln!(text, "       {message}");
                    }
                }
            }
            let DeviceReport { passed, failed, skipped, .. } = report;
            let _ = writeln!(text, "\n{passed} passed, {failed} failed, {skipped} skipped ({})", self.effort);
            let mut reasons: BTreeMap<&str, usize> = BTreeMap::new();
            report
                .rows
                .iter()
                .filter_map(|row| row.reason.as_deref())
                .for_each(|r| *reasons.entry(r).or_default() += 1);
            for (reason, rows) in reasons {
                let _ = writeln!(text, "  {rows} skipped: {reason}");
            }
            if let Some(error) = &report.error {
                let _ = writeln!(text, "  failed: {error}");
            }
            text.push('\n');
        }
        text
    }
}

/// A row of `--list --json`.
#[derive(Serialize)]
pub struct Listed<'a> {
    id: &'a str,
    group: &'static str,
    what: &'a str,
    why: &'static str,
    spec: &'static str,
}

impl<'a> Listed<'a> {
    pub fn new(check: &'a Check) -> Self {
        Self { id: &check.id, group: check.group.name(), what: &check.what, why: check.why, spec: check.spec }
    }
}

/// The matrix in words.
pub fn list(checks: &[Check]) -> String {
    let mut text = String::new();
    for group in Group::ALL {
        let mut rows = checks.iter().filter(|check| check.group == group).peekable();
        if rows.peek().is_some() {
            let _ = writeln!(text, "{}: {}", group.name(), group.about());
        }
        for check in rows {
            let _ = writeln!(
                text,
                "  {}\n      {}\n      why: {}\n      spec: {}",
                check.id, check.what, check.why, check.spec
            );
        }
    }
    text
}
