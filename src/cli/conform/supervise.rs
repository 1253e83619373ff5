//! Workers, one after the other: where one dies or hangs, the next goes on behind the check it was at.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use welkin::conform::Check;
use welkin::{Error, Result};

use super::super::progress::note;
use super::Message;
use super::report::{DeviceReport, Row};

/// How a worker ended.
enum End {
    Exited(ExitStatus),
    TimedOut,
}

/// Tries `checks` by processes that `worker` starts from a row on; none may be silent for more than `timeout` seconds.
/// `progress` is told how many rows there are.
pub fn supervise(
    checks: &[Check],
    timeout: u64,
    worker: impl Fn(usize) -> Command,
    progress: &mut dyn FnMut(usize),
) -> Result<DeviceReport> {
    let mut report = DeviceReport::default();
    while report.rows.len() < checks.len() {
        let before = report.rows.len();
        let (begun, end) = follow(worker(before), timeout, &mut report, progress)?;
        let how = match &end {
            End::Exited(status) => format!("the process {}", describe(*status)),
            End::TimedOut => format!("nothing for {timeout} s"),
        };
        match begun.and_then(|index| checks.get(index)) {
            Some(check) => {
                let row = Row::broken(check, how);
                note(&row.line());
                report.rows.push(row);
            }
            // A failed device: its row is there, and the next worker goes on.
            None if report.rows.len() > before => {}
            None if matches!(&end, End::Exited(status) if status.code() == Some(2)) => {
                // The worker has said why on standard error: no such device, no driver.
                return Err(Error::Unsupported {
                    needed: "a device to try the checks on (see above)".into(),
                    by: "this system".into(),
                });
            }
            None => {
                report.error = Some(format!("{how} before the first check"));
                break;
            }
        }
        progress(report.rows.len());
    }
    report.count();
    Ok(report)
}

/// Runs one worker to its end; the row that it had begun and not ended, and how it ended.
fn follow(
    mut command: Command,
    timeout: u64,
    report: &mut DeviceReport,
    progress: &mut dyn FnMut(usize),
) -> Result<(Option<usize>, End)> {
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
        match messages.recv_timeout(Duration::from_secs(timeout)) {
            Ok(line) => match serde_json::from_str(&line) {
                Ok(Message::Device(device, of)) => (report.device, report.of) = (Some(device), of),
                Ok(Message::Begin(index)) => begun = Some(index),
                Ok(Message::Row(row)) => {
                    if row.failed() {
                        note(&row.line());
                    }
                    report.rows.push(row);
                    begun = None;
                    progress(report.rows.len());
                }
                Err(_) => note(&line), // Something that a driver prints.
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

#[cfg(all(test, unix))]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::report;
    use super::*;
    use welkin::conform::{Group, Outcome, Verdict};

    fn checks() -> Vec<Check> {
        let pass = |_: &mut welkin::conform::Lab| Ok(Verdict::Pass(String::new()));
        ["a", "b", "c"].map(|name| Check::new(Group::Blocks, name, name, pass)).into()
    }

    /// A worker that is a shell: `script` after the rows that `good` says pass.
    fn shell(from: usize, good: std::ops::Range<usize>, script: &str) -> Command {
        let say = |message: &Message| format!("echo '{}'\n", serde_json::to_string(message).unwrap());
        let device = report::Device {
            index: 0,
            name: "shell".into(),
            kind: "cpu".into(),
            driver: String::new(),
            api: String::new(),
            validation: false,
        };
        let mut text = say(&Message::Device(device, 1));
        for index in good.start.max(from)..good.end {
            let verdict = Verdict::Pass(String::new());
            let outcome = Outcome { verdict, seconds: 0.0, validation: Vec::new(), device_failed: false };
            text += &say(&Message::Begin(index));
            text += &say(&Message::Row(Row::new(&checks()[index], outcome)));
        }
        let mut command = Command::new("/bin/sh");
        command.args(["-c", &(text + script)]);
        command
    }

    fn results(worker: impl Fn(usize) -> Command) -> (Vec<String>, DeviceReport) {
        let report = supervise(&checks(), 2, worker, &mut |_| {}).unwrap();
        (report.rows.iter().map(|row| row.result.clone()).collect(), report)
    }

    #[test]
    fn a_crash_is_a_result_and_the_next_checks_are_tried() {
        let begin = serde_json::to_string(&Message::Begin(1)).unwrap();
        let (rows, report) = results(|from| match from {
            0 => shell(0, 0..1, &format!("echo '{begin}'; kill -SEGV $$")),
            _ => shell(from, 0..3, ""),
        });
        assert_eq!(rows, ["pass", "fail", "pass"]);
        let found = report.rows[1].found.as_deref();
        assert_eq!(found, Some("the process was ended by signal 11 (segmentation fault)"));
        assert_eq!((report.passed, report.failed, report.skipped, report.green()), (2, 1, 0, false));
    }

    #[test]
    fn a_hang_is_a_result_and_the_process_is_killed() {
        let begin = serde_json::to_string(&Message::Begin(2)).unwrap();
        let (rows, report) = results(|_| shell(0, 0..2, &format!("echo '{begin}'; exec sleep 60")));
        assert_eq!(rows, ["pass", "pass", "fail"]);
        assert_eq!(report.rows[2].found.as_deref(), Some("nothing for 2 s"));
    }

    #[test]
    fn a_worker_may_leave_after_a_row_and_another_goes_on() {
        let (rows, report) = results(|from| shell(from, 0..from + 1, ""));
        assert_eq!((rows, report.green()), (vec!["pass".to_owned(); 3], true));
    }

    #[test]
    fn what_a_driver_prints_is_no_result() {
        let (rows, _) = results(|from| shell(from, 0..3, "echo 'MESA: warning'; echo '{\"row\": 1}'"));
        assert_eq!(rows, ["pass"; 3]);
    }

    #[test]
    fn a_worker_that_never_comes_to_a_check_is_an_error() {
        let (rows, report) = results(|_| shell(0, 0..0, "kill -ABRT $$"));
        assert!(rows.is_empty() && !report.green());
        assert_eq!(report.error.as_deref(), Some("the process was ended by signal 6 (abort) before the first check"));
        let usage = supervise(&checks(), 2, |_| shell(0, 0..0, "exit 2"), &mut |_| {});
        assert!(usage.unwrap_err().to_string().contains("see above"));
    }
}
