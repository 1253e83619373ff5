//! Error of the scattering tables against the time that they take to make: every `detail` of the solver, and the coarse
//! set, against the same walks of Monte Carlo. Prints Markdown and writes a plot.
//!
//! `cargo run --release --example table_convergence -- OUT.svg` (docs/tables.md shows the result).

use std::fmt::Write;
use std::ops::ControlFlow;
use std::time::Instant;
use welkin::gpu::Frames;
use welkin::gpu::standalone::{Options, Standalone};
use welkin::lut::axes::{STEPS, ScatteringShape};
use welkin::lut::{Detail, ScatteringTable, TableParams, read_image};
use welkin::params::Clouds;
use welkin::reference::comparison::{Case, Deviation, random_cases};
use welkin::reference::monte_carlo::Medium;
use welkin::reference::scattering::ScatteringLookup;

const RAYS: usize = 200;
/// Density levels that are shown, and how many walks a ray gets on average there.
const SHOWN: [(u32, u32); 4] = [(1, 4000), (3, 8000), (5, 10_000), (7, 6000)];

/// Rays of one optical radius with what Monte Carlo found there.
struct Truth {
    optical_radius: f64,
    cases: Vec<Case>,
}

impl Truth {
    fn new(medium: &Medium, (level, walks): (u32, u32)) -> Self {
        let r = ScatteringShape::optical_radius(level * STEPS);
        Self { optical_radius: r, cases: random_cases(medium, r, r, RAYS, walks, 7919 + u64::from(level)) }
    }

    fn deviation(&self, table: &ScatteringLookup) -> Deviation {
        let pairs: Vec<_> = self.cases.iter().map(|c| (table.multiple(&c.ray, c.optical_radius), c.truth)).collect();
        Deviation::new(&pairs)
    }
}

/// CPU time of this process, all threads together [s]; wall time where the system does not tell.
fn cpu_seconds(started: Instant) -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let ticks = stat.rsplit(')').next().map(|tail| tail.split_whitespace().skip(11).take(2));
    let ticks: Vec<f64> = ticks.into_iter().flatten().filter_map(|field| field.parse().ok()).collect();
    if ticks.len() == 2 { (ticks[0] + ticks[1]) / 100.0 } else { started.elapsed().as_secs_f64() }
}

/// One way of making the table.
struct Run {
    name: String,
    wall: f64,
    cpu: f64,
    found: Vec<Deviation>,
}

fn run(
    frames: &mut Frames,
    medium: &Medium,
    shape: ScatteringShape,
    detail: f64,
    truths: &[Truth],
) -> welkin::Result<Run> {
    let table = ScatteringTable::new(&frames.gpu().clone(), shape)?;
    let started = Instant::now();
    let before = cpu_seconds(started);
    table.build(frames, medium, None, detail, &mut |_| ControlFlow::Continue(()))?;
    let (cpu, wall) = (cpu_seconds(started) - before, started.elapsed().as_secs_f64());
    let lookup = ScatteringLookup::new(shape, read_image(frames, table.image())?);
    let found = truths.iter().map(|truth| truth.deviation(&lookup)).collect();
    let coarse = if shape == ScatteringShape::FULL { "" } else { " (`Coarse`)" };
    Ok(Run { name: format!("{detail}{coarse}"), wall, cpu, found })
}

/// Both axes logarithmic: CPU seconds to the right, RMS error in per cent upwards.
fn plot(runs: &[Run], truths: &[Truth]) -> String {
    const COLOURS: [&str; 4] = ["#1b6ca8", "#2a9d5c", "#d98e04", "#b5382a"];
    let x = |seconds: f64| 60.0 + 180.0 * (seconds.max(1.0)).log10() * 1.5;
    let y = |percent: f64| 300.0 - 130.0 * (percent.max(0.2) / 0.2).log10();
    let mut svg = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"640\" height=\"350\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"640\" height=\"350\" fill=\"white\"/>\n",
    );
    // Writing to a string cannot fail.
    for seconds in [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0] {
        let _ = writeln!(
            svg,
            "<line x1=\"{0:.1}\" x2=\"{0:.1}\" y1=\"20\" y2=\"300\" stroke=\"#ddd\"/><text x=\"{0:.1}\" y=\"316\" \
             text-anchor=\"middle\">{seconds}</text>",
            x(seconds)
        );
    }
    for percent in [0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0] {
        let _ = writeln!(
            svg,
            "<line x1=\"60\" x2=\"600\" y1=\"{0:.1}\" y2=\"{0:.1}\" stroke=\"#ddd\"/><text x=\"52\" y=\"{1:.1}\" \
             text-anchor=\"end\">{percent}</text>",
            y(percent),
            y(percent) + 4.0
        );
    }
    let _ = writeln!(svg, "<text x=\"330\" y=\"338\" text-anchor=\"middle\">CPU time of the build [s]</text>");
    let _ = writeln!(svg, "<text x=\"62\" y=\"14\">RMS error against Monte Carlo [%], random rays</text>");
    for (k, truth) in truths.iter().enumerate() {
        let colour = COLOURS[k % COLOURS.len()];
        let full: Vec<&Run> = runs.iter().filter(|run| !run.name.contains("Coarse")).collect();
        let points: Vec<String> =
            full.iter().map(|run| format!("{:.1},{:.1}", x(run.cpu), y(100.0 * run.found[k].rms()))).collect();
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>",
            points.join(" ")
        );
        for run in runs {
            let coarse = run.name.contains("Coarse");
            let (radius, fill) = if coarse { (5, "none") } else { (3, colour) };
            let (cx, cy) = (x(run.cpu), y(100.0 * run.found[k].rms()));
            let _ = writeln!(
                svg,
                "<circle cx=\"{cx:.1}\" cy=\"{cy:.1}\" r=\"{radius}\" fill=\"{fill}\" stroke=\"{colour}\"/>"
            );
        }
        let (r, at) = (truth.optical_radius, 36.0 + 18.0 * k as f64);
        let _ = writeln!(svg, "<text x=\"520\" y=\"{at}\" fill=\"{colour}\">R = {r:.2}</text>");
    }
    let _ = writeln!(svg, "<text x=\"520\" y=\"108\">rings: `Coarse`</text>");
    svg + "</svg>\n"
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let out = std::env::args().nth(1).ok_or("name the plot to write")?;
    let mut device = Standalone::new(Options::default())?;
    let medium = TableParams::new(&Clouds::default(), Detail::Full).medium;
    let truths = SHOWN.map(|level| Truth::new(&medium, level));
    let mut runs = Vec::new();
    runs.push(run(device.frames(), &medium, ScatteringShape::COARSE, 0.4, &truths)?);
    for detail in [0.25, 0.4, 0.6, 0.8, 1.0] {
        runs.push(run(device.frames(), &medium, ScatteringShape::FULL, detail, &truths)?);
    }
    println!(
        "| `detail` | wall | CPU | {} |",
        truths.each_ref().map(|t| format!("R = {:.2}", t.optical_radius)).join(" | ")
    );
    println!("|---|---|---|{}", "---|".repeat(truths.len()));
    for run in &runs {
        let errors: Vec<String> =
            (run.found.iter()).map(|d| format!("{:.1} % (< {:.1})", 100.0 * d.rms(), 100.0 * d.rms_bound())).collect();
        println!("| {} | {:.1} s | {:.1} s | {} |", run.name, run.wall, run.cpu, errors.join(" | "));
    }
    std::fs::write(out, plot(&runs, &truths))?;
    Ok(())
}
