//! What long commands do when they are asked to end: by Ctrl-C (SIGINT) or by SIGTERM, as systems that shut down send it.
//!
//! The first signal is noted, and the command ends at the next point where nothing is lost by it; a second one ends the
//! program at once. The exit status is the one that shells give to programs that end by a signal: 128 and its number.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use welkin::{Error, Result};

/// A signal that ends a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Signal(u8);

const SIGNALS: [(i32, &str); 2] = [(SIGINT, "SIGINT"), (SIGTERM, "SIGTERM")];

impl Signal {
    pub fn status(self) -> u8 {
        128 + self.0
    }
}

impl std::fmt::Display for Signal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let row = SIGNALS.iter().find(|row| row.0 == i32::from(self.0));
        f.write_str(row.map_or("a signal", |row| row.1))
    }
}

/// Tells whether the command is to end.
pub struct Interrupt(Arc<AtomicUsize>);

impl Interrupt {
    /// From now on a signal does not end the program unless it is the second one.
    ///
    /// # Errors
    /// If the system takes no handlers of signals.
    pub fn watch() -> Result<Self> {
        let fault = |error: std::io::Error| Error::Unsupported {
            needed: format!("handling of signals ({error})"),
            by: "this system".into(),
        };
        let (again, first) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicUsize::new(0)));
        for (signal, _) in SIGNALS {
            // Handlers run in this order: the first signal finds `again` false and sets it.
            flag::register_conditional_shutdown(signal, 128 + signal, again.clone()).map_err(fault)?;
            flag::register(signal, again.clone()).map_err(fault)?;
            flag::register_usize(signal, first.clone(), signal as usize).map_err(fault)?;
        }
        Ok(Self(first))
    }

    /// The signal that has come.
    pub fn signal(&self) -> Option<Signal> {
        u8::try_from(self.0.load(Ordering::Relaxed)).ok().filter(|signal| *signal != 0).map(Signal)
    }
}
