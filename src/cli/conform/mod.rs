//! `welkin conform`: what a driver must do for Welkin, tried check by check.
//!
//! The checks of each device run in a process of their own (`worker`), which says on its standard output what it begins and
//! what came of it. Where it dies or hangs, that is the result of the check it was at, and another one goes on behind it.

mod report;
mod worker;

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use welkin::conform::{self, Check, matches};
use welkin::{Error, Result};

use super::args::ConformArgs;
use super::progress::{Progress, note};
use report::{DeviceReport, Report, Row};

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

/// Tries every check on one device.
fn device(args: &ConformArgs, checks: &[Check], wanted: Option<String>) -> Result<DeviceReport> {
    let mut report = DeviceReport::default();
    let label = wanted.as_ref().map_or_else(|| "conform".to_owned(), |name| format!("conform, device {name}"));
    let mut progress = Progress::start(label, checks.len() as u64);
    while report.rows.len() < checks.len() {
        let before = report.rows.len();
        let (begun, end) = worker(args, wanted.as_deref(), before, &mut report, &mut progress)?;
        match end {
            End::Exited(status) if report.rows.len() == before && begun.is_none() => {
                if status.code() == Some(2) {
                    // A usage error or no such device: the worker has said so on standard error.
                    return Err(Error::Unsupported {
                        needed: "a device to try the checks on (see above)".into(),
                        by: "this system".into(),
                    });
                }
                report.error = Some(format!("the process {} before the first check", describe(status)));
                break;
            }
            End::Exited(status) => {
                if let Some(check) = begun.and_then(|index| checks.get(index)) {
                    report.rows.push(Row::broken(check, format!("the process {}", describe(status))));
                }
            }
            End::TimedOut => match begun.and_then(|index| checks.get(index)) {
                Some(check) => {
                    report.rows.push(Row::broken(check, format!("no end after {} s", args.timeout)));
                }
                None => {
                    report.error = Some(format!("no device after {} s", args.timeout));
                    break;
                }
            },
        }
        progress.set(report.rows.len() as u64);
    }
    report.count();
    Ok(report)
}

enum End {
    Exited(ExitStatus),
    TimedOut,
}

/// Runs one worker from row `from` on, to its end; the row that it had begun and not ended, and how it ended.
fn worker(
    args: &ConformArgs,
    wanted: Option<&str>,
    from: usize,
    report: &mut DeviceReport,
    progress: &mut Progress,
) -> Result<(Option<usize>, End)> {
    let mut command = myself();
    command.args(["conform", "--worker", &from.to_string()]);
    if let Some(wanted) = wanted {
        command.args(["--device", wanted]);
    }
    if args.quick {
        command.arg("--quick");
    }
    for pattern in &args.filter {
        command.args(["--filter", pattern]);
    }
    let fault = |error: std::io::Error| Error::Unsupported {
        needed: format!("a second process of Welkin's own ({error})"),
        by: "this system".into(),
    };
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn().map_err(fault)?;
    let (sender, messages) = mpsc::channel();
    if let Some(output) = child.stdout.take() {
        std::thread::spawn(move || {
            for line in BufReader::new(output).lines().map_while(std::io::Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
    }
    let mut begun = None;
    loop {
        match messages.recv_timeout(Duration::from_secs(args.timeout)) {
            Ok(line) => match serde_json::from_str(&line) {
                Ok(Message::Device(device, of)) => (report.device, report.of) = (Some(device), of),
                Ok(Message::Begin(index)) => begun = Some(index),
                Ok(Message::Row(row)) => {
                    if row.failed() {
                        note(&row.line());
                    }
                    report.rows.push(row);
                    begun = None;
                    progress.set(report.rows.len() as u64);
                }
                Err(_) => note(&line), // Something a driver prints.
            },
            Err(RecvTimeoutError::Disconnected) => return Ok((begun, End::Exited(child.wait().map_err(fault)?))),
            Err(RecvTimeoutError::Timeout) => {
                kill(&mut child);
                return Ok((begun, End::TimedOut));
            }
        }
    }
}

fn kill(child: &mut Child) {
    // One that has ended by now needs no killing; either way it is waited for, so that none is left behind.
    let _ = child.kill();
    let _ = child.wait();
}

/// A command that starts this program again, on the same driver.
fn myself() -> Command {
    // On a prefix with a libc of its own the running executable is that libc's loader; the prefix's starter takes the
    // program's own name (docs/drivers.md).
    let starter = std::env::var_os("WELKIN_PREFIX").map(|prefix| std::path::PathBuf::from(prefix).join("run"));
    match (starter, std::env::args_os().next(), std::env::current_exe()) {
        (Some(starter), Some(program), _) => {
            let mut command = Command::new(starter);
            command.arg(program);
            command
        }
        (None, _, Ok(program)) => Command::new(program),
        (_, program, _) => Command::new(program.unwrap_or_else(|| "welkin".into())),
    }
}

fn describe(status: ExitStatus) -> String {
    #[cfg(unix)]
    {
        use std::os::unix::process::ExitStatusExt;
        if let Some(signal) = status.signal() {
            let name = match signal {
                4 => " (illegal instruction)",
                6 => " (abort)",
                7 => " (bus error)",
                8 => " (arithmetic)",
                9 => " (killed)",
                11 => " (segmentation fault)",
                _ => "",
            };
            return format!("was ended by signal {signal}{name}");
        }
    }
    status.code().map_or_else(|| "ended".to_owned(), |code| format!("ended with status {code}"))
}
