//! Full tables in the making while frames are rendered with coarse ones.

use super::{Progress, TableData};
use crate::{Error, Result};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::JoinHandle;

/// What the maker of tables calls with its progress; it has to stop on `Break`.
pub type ProgressFn<'a> = &'a mut dyn FnMut(Progress) -> ControlFlow<()>;

/// A thread that makes tables. Dropping it stops the work, which leaves the cache as it was.
pub struct Background {
    stop: Arc<AtomicBool>,
    fraction: Arc<AtomicU32>,
    thread: Option<JoinHandle<Result<Option<TableData>>>>,
}

impl Background {
    /// Starts `make` on a thread of its own: it opens a device or a queue that is not the renderer's, calls
    /// [`super::Tables::load_or_build`] there with the progress function that it is given, and downloads the result.
    pub fn start(make: impl FnOnce(ProgressFn<'_>) -> Result<Option<TableData>> + Send + 'static) -> Result<Self> {
        let (stop, fraction) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU32::new(0)));
        let (stopped, told) = (stop.clone(), fraction.clone());
        let work = move || {
            make(&mut |progress| {
                told.store(progress.fraction.to_bits(), Ordering::Relaxed);
                if stopped.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            })
        };
        let thread = std::thread::Builder::new().name("tables".into()).spawn(work);
        let thread = thread.map_err(|error| Error::Unsupported {
            needed: "a thread that makes tables".into(),
            by: format!("this system: {error}"),
        })?;
        Ok(Self { stop, fraction, thread: Some(thread) })
    }

    /// How far it has come, 0..=1.
    pub fn fraction(&self) -> f32 {
        f32::from_bits(self.fraction.load(Ordering::Relaxed))
    }

    /// The tables, once, as soon as they are there; never waits. An error of the maker comes out here too.
    pub fn poll(&mut self) -> Result<Option<TableData>> {
        if self.thread.as_ref().is_some_and(JoinHandle::is_finished) { self.join() } else { Ok(None) }
    }

    fn join(&mut self) -> Result<Option<TableData>> {
        match self.thread.take().map(JoinHandle::join) {
            None => Ok(None),
            Some(Ok(made)) => made,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
        }
    }
}

impl Drop for Background {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join(); // What it made is no longer wanted, nor why it could not.
        }
    }
}
