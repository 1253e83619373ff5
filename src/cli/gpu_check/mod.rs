//! `welkin gpu-check`: everything that is to be known about a device, in minutes. Each measurement is a process of its own
//! with a limit; results are written after each, so that a run that is cut off has not been for nothing.

mod child;
mod plan;
mod report;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use welkin::output::{write_atomic, write_json};
use welkin::{Error, Result};

use super::args::{GpuCheckArgs, ScaleArg};
use super::interrupt::Interrupt;
use super::progress::note;
use super::{Outcome, conform, places};
use child::Ended;
use plan::{Places, Step, Task};
use report::{Earlier, Report};

/// Time for all steps where none is given.
const BUDGET: u64 = 360;

/// A task may take so much of the time that is left to its step.
const SHARE: f64 = 0.6;

/// A picture for a kit may take so long: its driver is a CPU's, and the first makes the tables.
const FILL_LIMIT: Duration = Duration::from_secs(600);

/// Results, and where they go.
struct Book<'a> {
    args: &'a GpuCheckArgs,
    started: Instant,
    report: Report,
    /// The earlier run on this device and driver.
    earlier: Option<Earlier>,
}

pub fn run(args: &GpuCheckArgs) -> Result<Outcome> {
    let interrupt = Interrupt::watch()?;
    if !args.kit.join("scenes").is_dir() {
        let expected = "what `scripts/gpu-check prepare` has made, unpacked: a directory with scenes in it";
        return Err(Error::invalid("--kit", args.kit.display(), expected));
    }
    if args.fill_kit {
        return fill(args, &interrupt);
    }
    let scale = match args.scale {
        ScaleArg::Full => "full",
        ScaleArg::Modest => "modest",
        ScaleArg::Tiny => "tiny",
    };
    let raw = args.out.join("run");
    places::directory(&raw)?;
    let report = Report {
        format: 1,
        welkin: env!("CARGO_PKG_VERSION").into(),
        started: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs()),
        scale: scale.into(),
        budget_seconds: args.budget.unwrap_or(BUDGET),
        host_cores: std::thread::available_parallelism().map_or(0, usize::from),
        ..Report::default()
    };
    let mut book = Book { args, started: Instant::now(), report, earlier: None };
    let places = Places { kit: &args.kit, raw: &raw, device: args.device.as_deref() };
    for step in plan::plan(args.scale, &places, &tests(&args.kit)) {
        book.step(step, &raw, &interrupt)?;
        if let Some(signal) = interrupt.signal() {
            return Ok(Outcome::Stopped(signal));
        }
    }
    let result = |wanted: &str| book.report.steps.iter().flat_map(|s| &s.tasks).any(|task| task.result == wanted);
    Ok(Outcome::of(!["failed", "error", "cut"].into_iter().any(result)))
}

/// Makes the pictures that devices are compared with, and the tables, in the kit.
fn fill(args: &GpuCheckArgs, interrupt: &Interrupt) -> Result<Outcome> {
    let places = Places { kit: &args.kit, raw: &args.out, device: args.device.as_deref() };
    places::directory(&args.out)?;
    for task in plan::fill(args.scale, &places) {
        if let plan::Kind::Picture { reference, .. } = &task.kind {
            places::directory(reference.parent().unwrap_or(&args.kit))?;
        }
        let place = args.out.join(format!("fill-{}", task.name));
        let ended = child::run(command(&task), FILL_LIMIT, &place, &|| interrupt.signal().is_some())?;
        if let Some(signal) = interrupt.signal() {
            return Ok(Outcome::Stopped(signal));
        }
        if !ended.status.is_some_and(|status| status.success()) {
            return Err(Error::file(&task.name, format!("cannot be rendered: {}", last_line(&ended))));
        }
        note(&format!("{}: {:.1} s", task.name, ended.seconds));
    }
    Ok(Outcome::Done)
}

impl Book<'_> {
    /// Runs the tasks of a step, and writes the report after each.
    fn step(&mut self, step: Step, raw: &Path, interrupt: &Interrupt) -> Result<()> {
        let began = Instant::now();
        let limit_seconds = step.limit.as_secs_f64();
        let Step { name, about, .. } = step;
        self.report.steps.push(report::Step { name, about, limit_seconds, seconds: 0.0, tasks: Vec::new() });
        for (index, task) in step.tasks.iter().enumerate() {
            let budget = Duration::from_secs(self.report.budget_seconds).saturating_sub(self.started.elapsed());
            let left = step.limit.saturating_sub(began.elapsed()).min(budget);
            // One that hangs leaves something to those behind it.
            let left = if index + 1 < step.tasks.len() { left.mul_f64(SHARE) } else { left };
            let skipped = match step.gpu_only {
                Some(reason) if self.report.device.is_cpu() => Some(reason),
                _ if budget.is_zero() => Some("the time for all steps is up"),
                _ if left.is_zero() => Some("the step's time is up"),
                _ => None,
            };
            let done = match skipped {
                Some(reason) => report::Task {
                    name: task.name.clone(),
                    result: "left out",
                    reason: Some(reason.into()),
                    seconds: 0.0,
                    host_peak_bytes: None,
                },
                None => self.task(task, left, &raw.join(place(name, &task.name)), interrupt)?,
            };
            let told = done.reason.as_ref().map(|reason| format!(": {reason}")).unwrap_or_default();
            note(&format!("{name}, {}: {} after {:.1} s{told}", done.name, done.result, done.seconds));
            if let Some(step) = self.report.steps.last_mut() {
                step.tasks.push(done);
                step.seconds = began.elapsed().as_secs_f64();
            }
            self.write()?;
            if interrupt.signal().is_some() {
                break;
            }
        }
        Ok(())
    }

    fn task(&mut self, task: &Task, limit: Duration, place: &Path, interrupt: &Interrupt) -> Result<report::Task> {
        let ended = child::run(command(task), limit, place, &|| interrupt.signal().is_some())?;
        // 1 is how `conform` and tests say that something failed; what they printed counts.
        let code = ended.status.map(|status| status.code());
        let (result, reason) = match code {
            None if interrupt.signal().is_some() => ("cut", Some("it was stopped by a signal".to_owned())),
            None => ("cut", Some(format!("its time was up after {:.0} s", limit.as_secs_f64()))),
            Some(Some(0)) => match plan::collect(task, &ended, &mut self.report) {
                Ok(()) => ("done", None),
                Err(reason) => ("error", Some(reason)),
            },
            Some(Some(1 | 101)) => match plan::collect(task, &ended, &mut self.report) {
                Ok(()) => ("failed", Some("see below, and what it printed".to_owned())),
                Err(_) => ("error", Some(last_line(&ended))),
            },
            Some(code) => {
                let how = code.map_or("ended by a signal".into(), |code| format!("status {code}"));
                ("error", Some(format!("{how}: {}", last_line(&ended))))
            }
        };
        if matches!(task.kind, plan::Kind::Device) {
            self.earlier = self.earlier();
        }
        let Ended { seconds, host_peak_bytes, .. } = ended;
        Ok(report::Task { name: task.name.clone(), result, reason, seconds, host_peak_bytes })
    }

    /// The last run on this device, if there is one and it can be read.
    fn earlier(&self) -> Option<Earlier> {
        let folder = self.args.previous.as_ref().unwrap_or(&self.args.out);
        let path = folder.join(self.report.device.slug()).with_extension("json");
        let text = std::fs::read_to_string(&path).ok()?;
        serde_json::from_str(&text)
            .inspect_err(|error| note(&format!("warning: {}: not compared with: {error}", path.display())))
            .ok()
    }

    fn write(&mut self) -> Result<()> {
        self.report.seconds = self.started.elapsed().as_secs_f64();
        self.report.settle(self.earlier.as_ref());
        let slug = self.report.device.slug();
        let unknown = report::Device::default().slug();
        if slug != unknown {
            // What was written before the device was known is in these files too. Where there is none, nothing is to do.
            for end in ["json", "md"] {
                let _ = std::fs::remove_file(self.args.out.join(&unknown).with_extension(end));
            }
        }
        write_json(&self.args.out.join(&slug).with_extension("json"), &self.report)?;
        let page = self.report.markdown();
        write_atomic(&self.args.out.join(&slug).with_extension("md"), |out| out.write_all(page.as_bytes()))
    }
}

/// Where a task's output goes.
fn place(step: &str, task: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
    format!("{step}-{}", task.chars().map(plain).collect::<String>())
}

/// The process of a task, on the driver that this process runs on.
fn command(task: &Task) -> Command {
    let mut command = match &task.program {
        None => conform::myself(),
        Some(program) => conform::started(program),
    };
    command.args(&task.args);
    command
}

fn last_line(ended: &Ended) -> String {
    let lines = ended.stderr.lines().rev().chain(ended.stdout.lines().rev());
    lines.map(str::trim).find(|line| !line.is_empty()).unwrap_or("it printed nothing").to_owned()
}

/// The test programs of a kit, by name.
fn tests(kit: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(kit.join("tests")).into_iter().flatten().flatten();
    let mut tests: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(|path| path.is_file()).collect();
    tests.sort();
    tests
}
