//! Long commands that are asked to end: by Ctrl-C (SIGINT) and by SIGTERM.
#![cfg(target_os = "linux")]
mod support;

use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use support::folder::{BALLS, command, directory, files, run};

const INTERRUPT: (&str, i32) = ("INT", 2);
const TERMINATE: (&str, i32) = ("TERM", 15);

/// A command under way; killed if the test fails.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Running {
    /// Starts `welkin` with the words of `line` and waits until it handles both signals.
    fn start(directory: &Path, line: &str) -> Self {
        let child = command(directory, line).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let mut running = Self(child);
        let handled = 1 << (INTERRUPT.1 - 1) | 1u64 << (TERMINATE.1 - 1);
        running.wait_until("it handles signals", |running| running.caught() & handled == handled);
        running
    }

    /// The signals that it has handlers for, a bit each.
    fn caught(&self) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.0.id())).unwrap();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap();
        u64::from_str_radix(mask.trim(), 16).unwrap()
    }

    fn wait_until(&mut self, what: &str, mut condition: impl FnMut(&Self) -> bool) {
        let started = Instant::now();
        while !condition(self) {
            assert!(self.0.try_wait().unwrap().is_none(), "it ended before {what}: {}", self.said());
            assert!(started.elapsed() < Duration::from_secs(60), "a minute, and not yet: {what}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn send(&self, signal: (&str, i32)) {
        let status = Command::new("kill").args(["-s", signal.0, &self.0.id().to_string()]).status().unwrap();
        assert!(status.success());
    }

    fn said(&mut self) -> String {
        let mut text = String::new();
        self.0.stderr.take().unwrap().read_to_string(&mut text).unwrap();
        text
    }

    /// Waits for its end, which is as shells tell of this signal; what it said.
    fn ended_by(mut self, signal: (&str, i32)) -> String {
        let said = self.said();
        assert_eq!(self.0.wait().unwrap().code(), Some(128 + signal.1), "{said}");
        said
    }
}

#[test]
fn a_reference_keeps_what_it_has_and_goes_on_to_the_same_bits() {
    for (signal, name) in [(INTERRUPT, "SIGINT"), (TERMINATE, "SIGTERM")] {
        let directory = directory(BALLS);
        let path = directory.path();
        let line = "reference sky.toml --size 12x8";
        let running = Running::start(path, &format!("{line} -o a.exr --spp 100000000"));
        std::thread::sleep(Duration::from_millis(700)); // into some pass, or still before the first: both must do
        running.send(signal);
        let said = running.ended_by(signal);
        assert!(said.contains(&format!("stopped by {name}: the same command with --resume a.state goes on")), "{said}");
        assert_eq!(files(path), ["a.exr", "a.state", "a.variance.exr"]);

        let line_of = said.lines().find(|line| line.contains("wrote a.exr")).unwrap();
        let samples: u32 = line_of.split(" samples").next().unwrap().rsplit(' ').next().unwrap().parse().unwrap();
        let all = samples + 30;
        run(path, &format!("{line} -o b.exr --spp {samples}"));
        let same = |a: &str, b: &str| {
            for end in ["exr", "variance.exr", "state"] {
                let read = |name: &str| std::fs::read(path.join(name).with_extension(end)).unwrap();
                assert!(read(a) == read(b), "{name}, {samples} samples: {end} of {a} and {b} differ");
            }
        };
        same("a", "b");
        run(path, &format!("{line} -o a.exr --spp {all} --resume a.state"));
        run(path, &format!("{line} -o b.exr --spp {all}"));
        same("a", "b");
    }
}

#[test]
fn a_second_signal_ends_a_reference_at_once() {
    let directory = directory(BALLS);
    // A pass of a minute or so, longer than the time that it is given to end.
    let line = "reference sky.toml -o a.exr --size 1200x1200 --spp 100 --set clouds.sigma_t=1";
    let running = Running::start(directory.path(), line);
    std::thread::sleep(Duration::from_millis(500));
    running.send(INTERRUPT);
    std::thread::sleep(Duration::from_millis(500));
    let started = Instant::now();
    running.send(TERMINATE);
    running.ended_by(TERMINATE);
    assert!(started.elapsed() < Duration::from_secs(2), "{:?}", started.elapsed());
    assert_eq!(files(directory.path()), [""; 0]);
}

#[test]
fn voxelize_leaves_nothing() {
    for name in ["a.npy", "a.vdb"] {
        let directory = directory(BALLS);
        let line = format!("voxelize sky.toml -o {name} --resolution 1024");
        let running = Running::start(directory.path(), &line);
        running.send(TERMINATE);
        let said = running.ended_by(TERMINATE);
        assert!(said.contains("stopped by SIGTERM: nothing is written"), "{said}");
        assert_eq!(files(directory.path()), [""; 0]);
    }
}

#[test]
fn precompute_leaves_the_cache_whole() {
    let directory = directory("");
    let (path, cache) = (directory.path(), directory.path().join("cache"));
    let mut running = Running::start(path, "precompute --out out");
    let kept = || if cache.exists() { files(&cache) } else { Vec::new() };
    // One table of two is made in a moment, the other in minutes.
    running.wait_until("a table", |_| kept().iter().any(|name| name.ends_with(".table")));
    running.send(INTERRUPT);
    let said = running.ended_by(INTERRUPT);
    assert!(said.contains("stopped: no table is written"), "{said}");
    assert_eq!(files(path), ["cache"]);
    assert!(matches!(&kept()[..], [name] if name.starts_with("optical-depth-")), "{:?}", kept());
    // What is there is whole: it is read again without a word, as the next end before the other table shows.
    let before = std::fs::read(cache.join(&kept()[0])).unwrap();
    let running = Running::start(path, "precompute --out out");
    running.send(TERMINATE);
    let said = running.ended_by(TERMINATE);
    assert!(!said.contains("warning"), "{said}");
    assert!(std::fs::read(cache.join(&kept()[0])).unwrap() == before);
}
