//! The process that tries the checks.

use std::io::Write;

use welkin::Result;
use welkin::conform::{Check, Effort, Lab, LabOptions, Outcome, Sabotage, Verdict};
use welkin::gpu::standalone;

use super::super::args::ConformArgs;
use super::Message;
use super::report::{Device, Row};

/// Tries the checks from row `from` on, until the last or until the device fails; says so on standard output.
pub fn run(args: &ConformArgs, checks: &[Check], from: usize) -> Result<()> {
    let devices = standalone::devices()?;
    let index = standalone::find(&devices, args.device.as_deref())?;
    let capabilities = &devices[index];
    let mut device = Device::new(capabilities, index);
    if !capabilities.missing.is_empty() {
        let reason = format!("Welkin does not run on this device: it lacks {}", capabilities.missing.join(", "));
        say(&Message::Device(device, devices.len()))?;
        for check in &checks[from..] {
            let verdict = Verdict::Skip(reason.clone());
            let outcome = Outcome { verdict, seconds: 0.0, validation: Vec::new(), device_failed: false };
            say(&Message::Row(Row::new(check, outcome)))?;
        }
        return Ok(());
    }
    let effort = if args.quick { Effort::Quick } else { Effort::Full };
    let sabotage = args.unordered.then_some(Sabotage::UnorderedUnseen);
    let mut lab = Lab::open(LabOptions { device: Some(index.to_string()), effort, sabotage })?;
    device.validation = lab.validated();
    say(&Message::Device(device, devices.len()))?;
    for (index, check) in checks.iter().enumerate().skip(from) {
        say(&Message::Begin(index))?;
        let mut outcome = check.run(&mut lab);
        let failed = outcome.device_failed;
        if args.unordered && !failed {
            outcome.verdict = shown(outcome.verdict);
        }
        say(&Message::Row(Row::new(check, outcome)))?;
        if failed {
            break; // A failed device is not used again: another process goes on.
        }
    }
    Ok(())
}

/// The verdict on a check from which ordering was taken away: it passes if it has noticed.
fn shown(verdict: Verdict) -> Verdict {
    match verdict {
        Verdict::Fail { found, .. } => Verdict::Pass(format!("without ordering: {found}")),
        Verdict::Pass(_) => Verdict::fail("a wrong picture without ordering", "the right one"),
        skip @ Verdict::Skip(_) => skip,
    }
}

fn say(message: &Message) -> Result<()> {
    let fault = |reason: String| welkin::Error::file("standard output", reason);
    let line = serde_json::to_string(message).map_err(|error| fault(error.to_string()))?;
    let mut output = std::io::stdout().lock();
    writeln!(output, "{line}").and_then(|()| output.flush()).map_err(|error| fault(error.to_string()))
}
