//! `welkin conform`: what a driver must do for Welkin, tried check by check.
//!
//! The checks of each device run in a process of their own (`worker`), which says on its standard output what it begins and
//! what came of it. Where it dies or hangs, that is the result of the check it was at, and another one goes on behind it.

mod report;
mod supervise;
mod worker;

use std::path::{Path, PathBuf};
use std::process::Command;

use serde::{Deserialize, Serialize};
use welkin::conform::{self, Check, Group, Sabotage, matches};
use welkin::{Error, Result};

use super::args::ConformArgs;
use super::progress::Progress;
use report::{DeviceReport, Report, Row};
use supervise::supervise;

/// What a worker says, a line of JSON each.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Message {
    /// The device is open, or cannot be used and every row will be skipped; and how many devices there are.
    Device(report::Device, usize),
    /// The row of this index begins.
    Begin(usize),
    /// The row that has begun has ended.
    Row(Row),
}

/// Runs the command; false if any check failed.
pub fn run(args: &ConformArgs) -> Result<bool> {
    let checks: Vec<Check> = conform::checks()
        .into_iter()
        .filter(|check| !args.unordered || of_order(check))
        .filter(|check| args.filter.is_empty() || args.filter.iter().any(|pattern| matches(pattern, &check.id)))
        .collect();
    if checks.is_empty() {
        return Err(Error::invalid(
            "--filter",
            args.filter.join(" "),
            "a pattern that some id of `welkin conform --list` matches",
        ));
    }
    if args.list {
        let rows: Vec<_> = checks.iter().map(report::Listed::new).collect();
        if args.json {
            super::print_json(&rows)?
        } else {
            super::print(&report::list(&checks))?
        }
        return Ok(true);
    }
    if let Some(from) = args.worker {
        return worker::run(args, &checks, from).map(|()| true);
    }
    let mut report = Report { effort: if args.quick { "quick" } else { "full" }, devices: Vec::new() };
    if args.all {
        let mut total = 1;
        while report.devices.len() < total {
            let device = device(args, &checks, Some(report.devices.len().to_string()))?;
            total = total.max(device.of);
            report.devices.push(device);
        }
    } else {
        report.devices.push(device(args, &checks, args.device.clone())?);
    }
    if args.json {
        super::print_json(&report)?
    } else {
        super::print(&report.text())?
    }
    Ok(report.devices.iter().all(DeviceReport::green))
}

/// Whether a check proves order, so that it must show when nobody asks for it.
fn of_order(check: &Check) -> bool {
    matches!(check.group, Group::Interlock | Group::Attachment) && check.fails_by.contains(&Sabotage::Unordered)
}

/// Tries every check on one device.
fn device(args: &ConformArgs, checks: &[Check], wanted: Option<String>) -> Result<DeviceReport> {
    let label = wanted.as_ref().map_or_else(|| "conform".to_owned(), |name| format!("conform, device {name}"));
    let mut progress = Progress::start(label, checks.len() as u64);
    let worker = |from: usize| {
        let mut command = myself();
        command.args(["conform", "--worker", &from.to_string()]);
        if let Some(wanted) = &wanted {
            command.args(["--device", wanted]);
        }
        if args.quick {
            command.arg("--quick");
        }
        if args.unordered {
            command.arg("--unordered");
        }
        for pattern in &args.filter {
            command.args(["--filter", pattern]);
        }
        command
    };
    supervise(checks, args.timeout, worker, &mut |done| progress.set(done as u64))
}

/// A command that starts this program again, on the same driver.
pub(super) fn myself() -> Command {
    // On a prefix with a libc of its own the running executable is that libc's loader; the program's own name is kept.
    match (starter(), std::env::args_os().next(), std::env::current_exe()) {
        (Some(_), Some(program), _) => started(Path::new(&program)),
        (None, _, Ok(program)) => Command::new(program),
        (_, program, _) => Command::new(program.unwrap_or_else(|| "welkin".into())),
    }
}

/// A command that starts another program of ours, on the same driver.
pub(super) fn started(program: &Path) -> Command {
    let Some(starter) = starter() else { return Command::new(program) };
    let mut command = Command::new(starter);
    command.arg(program);
    command
}

/// What starts programs on the prefix that this one runs on (docs/drivers.md).
fn starter() -> Option<PathBuf> {
    let starter = std::env::var_os("WELKIN_PREFIX").map(|prefix| PathBuf::from(prefix).join("run"));
    starter.filter(|starter| starter.exists())
}
