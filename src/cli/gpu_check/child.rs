//! A measurement in a process of its own, which has only so much time.

use std::fs::File;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use welkin::{Error, Result};

/// How often a running process is looked at: far below anything that is measured by the wall clock here.
const LOOK: Duration = Duration::from_millis(5);

/// How a measurement ended.
pub struct Ended {
    /// None if it was ended because its time was up or somebody asked.
    pub status: Option<ExitStatus>,
    pub seconds: f64,
    /// Most memory of the host's that was seen to be held [bytes]; none where the system does not tell.
    pub host_peak_bytes: Option<u64>,
    pub stdout: String,
    pub stderr: String,
}

/// Runs `command` for at most `limit`, or until `stop` says so; what it prints stays in `PLACE.out` and `PLACE.err`, the part
/// printed by a process that had to be ended too.
pub fn run(mut command: Command, limit: Duration, place: &Path, stop: &dyn Fn() -> bool) -> Result<Ended> {
    let files = ["out", "err"].map(|end| place.with_extension(end));
    let open = |path: &Path| File::create(path).map_err(|error| Error::file(path, format!("cannot be made: {error}")));
    command.stdin(Stdio::null()).stdout(open(&files[0])?).stderr(open(&files[1])?);
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0); // with its own children, to be ended together
    let started = Instant::now();
    let program = command.get_program().to_string_lossy().into_owned();
    let fault = |error: std::io::Error| Error::file(&program, format!("cannot be run: {error}"));
    let mut child = command.spawn().map_err(fault)?;
    let mut peak = None;
    let status = loop {
        peak = peak.max(host_peak(child.id()));
        if let Some(status) = child.try_wait().map_err(fault)? {
            break Some(status);
        }
        if started.elapsed() >= limit || stop() {
            end(&mut child);
            break None;
        }
        std::thread::sleep(LOOK);
    };
    let seconds = started.elapsed().as_secs_f64();
    let [stdout, stderr] =
        files.map(|path| String::from_utf8_lossy(&std::fs::read(path).unwrap_or_default()).into_owned());
    Ok(Ended { status, seconds, host_peak_bytes: peak, stdout, stderr })
}

/// Ends a process and those that it has started.
fn end(child: &mut Child) {
    // The standard library has no way to signal a group; every shell has. Should there be none, the process itself goes.
    let _ = Command::new("/bin/sh")
        .args(["-c", &format!("kill -s KILL -- -{}", child.id())])
        .stderr(Stdio::null())
        .status();
    let _ = child.kill();
    let _ = child.wait();
}

/// Peak resident memory of a process, as Linux tells.
fn host_peak(id: u32) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{id}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kib| kib * 1024)
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    fn shell(script: &str) -> Command {
        let mut command = Command::new("/bin/sh");
        command.args(["-c", script]);
        command
    }

    #[test]
    fn a_hanging_process_is_ended_in_time_with_its_children_and_what_it_printed_stays() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("hang");
        let script = "echo $$; sleep 100 & echo $!; wait";
        let ended = run(shell(script), Duration::from_millis(500), &place, &|| false).unwrap();
        assert!(ended.status.is_none() && ended.seconds < 20.0, "{}", ended.seconds);
        let ids: Vec<&str> = ended.stdout.lines().collect();
        assert_eq!(ids.len(), 2, "{}", ended.stdout);
        // Gone, or dead and not yet waited for by whoever inherited it.
        let alive =
            |id: &str| std::fs::read_to_string(format!("/proc/{id}/stat")).is_ok_and(|stat| !stat.contains(") Z "));
        let gone = |id: &str| {
            (0..200).any(|_| {
                !alive(id) || {
                    std::thread::sleep(LOOK);
                    false
                }
            })
        };
        assert!(ids.iter().all(|id| gone(id)), "{ids:?}");
    }

    #[test]
    fn a_process_that_ends_tells_how_and_what_it_held() {
        let folder = tempfile::tempdir().unwrap();
        let limit = Duration::from_secs(60);
        let ended =
            run(shell("echo a; echo b >&2; sleep 0.1; exit 3"), limit, &folder.path().join("x"), &|| false).unwrap();
        assert_eq!(ended.status.and_then(|status| status.code()), Some(3));
        assert_eq!((ended.stdout.as_str(), ended.stderr.as_str()), ("a\n", "b\n"));
        assert!(ended.host_peak_bytes.is_some_and(|bytes| bytes > 1 << 16));
        let ended = run(shell("sleep 100"), limit, &folder.path().join("y"), &|| true).unwrap();
        assert!(ended.status.is_none());
    }
}
