//! The tables of a scene's medium: which ones, and from where.

use std::ops::ControlFlow;
use std::path::Path;

use welkin::gpu::Frames;
use welkin::lut::{Background, Detail, TableParams, Tables};
use welkin::output::TableStats;
use welkin::params::{Params, Preset};
use welkin::{Error, Result};

use super::args::TablesArg;
use super::progress::{Progress, note};
use super::validation;

/// The tables that frames are lit from, and better ones that may be in the making.
pub struct TableSet {
    tables: Tables,
    stats: TableStats,
    better: Option<Background>,
}

impl TableSet {
    /// The tables for `params` to begin with.
    pub fn obtain(
        frames: &mut Frames,
        params: &Params,
        wanted: TablesArg,
        cache: &Path,
        device: Option<&str>,
    ) -> Result<Self> {
        let full = TableParams::new(&params.clouds, Detail::Full);
        let small = params.quality.cells <= Preset::Low.quality().cells;
        let detail = match wanted {
            TablesArg::Full => Detail::Full,
            TablesArg::Reduced => Detail::Coarse,
            TablesArg::Auto if !small => Detail::Full,
            TablesArg::Auto | TablesArg::Progressive if Tables::cached(&full, cache) => Detail::Full,
            TablesArg::Auto => {
                note("reduced tables for a first picture; --tables full or `welkin precompute` makes the full ones");
                Detail::Coarse
            }
            TablesArg::Progressive => Detail::Coarse,
        };
        let tables = make(frames, &TableParams::new(&params.clouds, detail), cache, &|| false)?;
        let tables = tables.ok_or_else(|| Error::file(cache, "the tables were not made"))?;
        let better = match (wanted, detail) {
            (TablesArg::Progressive, Detail::Coarse) => Some(beside(full, cache, device)?),
            _ => None,
        };
        Ok(Self { stats: stats(&tables), tables, better })
    }

    pub fn tables(&self) -> &Tables {
        &self.tables
    }

    pub fn stats(&self) -> &TableStats {
        &self.stats
    }

    /// Takes the better tables if they are there by now. No frame may be in flight.
    pub fn improve(&mut self, frames: &mut Frames) -> Result<()> {
        let Some(data) = self.better.as_mut().map(Background::poll).transpose()?.flatten() else { return Ok(()) };
        self.better = None;
        self.tables = Tables::upload(frames, data)?;
        self.stats = stats(&self.tables);
        report(&self.tables);
        Ok(())
    }
}

fn stats(tables: &Tables) -> TableStats {
    TableStats {
        from: if tables.built() { "built" } else { "cache" }.into(),
        size: if tables.params().detail == Detail::Full { "full" } else { "reduced" }.into(),
        seconds: tables.seconds(),
    }
}

/// Makes tables on a second device of the same name, which waits for none of the renderer's frames.
fn beside(params: TableParams, cache: &Path, device: Option<&str>) -> Result<Background> {
    let (cache, device) = (cache.to_owned(), device.map(str::to_owned));
    Background::start(move |progress| {
        let mut standalone = validation::open(device.as_deref(), false)?;
        let frames = standalone.frames();
        Tables::load_or_build(frames, &params, Some(&cache), progress)?.map(|made| made.download(frames)).transpose()
    })
}

/// Reads the tables from the cache, or builds them with a bar; none if `stop` came true before.
pub fn make(
    frames: &mut Frames,
    params: &TableParams,
    cache: &Path,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Tables>> {
    const STEPS: f32 = 1000.0;
    let mut bar = None;
    let tables = Tables::load_or_build(frames, params, Some(cache), &mut |progress| {
        let bar = bar.get_or_insert_with(|| Progress::start("tables", STEPS as u64));
        bar.set((progress.fraction * STEPS) as u64);
        if stop() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    drop(bar);
    tables.iter().for_each(report);
    Ok(tables)
}

/// Says what was wrong with the cache, and what was made.
fn report(tables: &Tables) {
    tables.warnings().iter().for_each(|warning| note(&format!("warning: {warning}")));
    if tables.built() {
        note(&format!("made the tables in {:.1} s", tables.seconds()));
    }
}
