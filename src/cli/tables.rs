//! The tables of a scene's medium: which ones, and from where.

use std::ops::ControlFlow;
use std::path::Path;

use welkin::gpu::Frames;
use welkin::lut::{Detail, TableParams, Tables};
use welkin::output::TableStats;
use welkin::params::{Params, Preset};
use welkin::{Error, Result};

use super::args::TablesArg;
use super::progress::{Progress, note};

/// The tables for `params`, and what is to be said about them.
pub fn obtain(frames: &mut Frames, params: &Params, wanted: TablesArg, cache: &Path) -> Result<(Tables, TableStats)> {
    let full = TableParams::new(&params.clouds, Detail::Full);
    let small = params.quality.cells <= Preset::Low.quality().cells;
    let detail = match wanted {
        TablesArg::Full => Detail::Full,
        TablesArg::Reduced => Detail::Coarse,
        TablesArg::Auto if !small || Tables::cached(&full, cache) => Detail::Full,
        TablesArg::Auto => {
            note("reduced tables for a first picture; --tables full or `welkin precompute` makes the full ones");
            Detail::Coarse
        }
    };
    let tables = make(frames, &TableParams::new(&params.clouds, detail), cache)?;
    let stats = TableStats {
        from: if tables.built() { "built" } else { "cache" }.into(),
        size: if detail == Detail::Full { "full" } else { "reduced" }.into(),
        seconds: tables.seconds(),
    };
    Ok((tables, stats))
}

/// Reads the tables from the cache, or builds them with a bar.
pub fn make(frames: &mut Frames, params: &TableParams, cache: &Path) -> Result<Tables> {
    const STEPS: f32 = 1000.0;
    let mut bar = None;
    let tables = Tables::load_or_build(frames, params, Some(cache), &mut |progress| {
        let bar = bar.get_or_insert_with(|| Progress::start("tables", STEPS as u64));
        bar.set((progress.fraction * STEPS) as u64);
        ControlFlow::Continue(())
    })?;
    drop(bar);
    // Only a break of the progress function ends without tables, and it makes none.
    let tables = tables.ok_or_else(|| Error::file(cache, "the tables were not made"))?;
    tables.warnings().iter().for_each(|warning| note(&format!("warning: {warning}")));
    if tables.built() {
        note(&format!("made the tables in {:.1} s", tables.seconds()));
    }
    Ok(tables)
}
