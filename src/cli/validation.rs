//! The devices that commands open, and validation of whole commands: with `WELKIN_VALIDATION=1` in the environment every
//! device is under the validation layer, and a command during which it says anything ends with an error. The tests start
//! every command so; `render --stats` counts messages by itself.

use std::sync::{Mutex, PoisonError};

use welkin::gpu::standalone::{Messages, Options, Standalone, validation_available};
use welkin::{Error, Result};

use super::progress::note;

const VARIABLE: &str = "WELKIN_VALIDATION";

/// What the layer says about devices opened while validation is demanded, those that are gone included.
static WATCHED: Mutex<Vec<Messages>> = Mutex::new(Vec::new());

/// Opens a device by part of its name or index, or the best. Validation is on where it is demanded, and where it is wanted
/// and its layer is installed.
pub fn open(device: Option<&str>, wanted: bool) -> Result<Standalone> {
    let demanded = std::env::var_os(VARIABLE).is_some_and(|value| !value.is_empty() && value != "0");
    let validation = demanded || wanted && validation_available();
    if wanted && !validation {
        note("the validation layer is not installed: validation_messages will be null");
    }
    let device = Standalone::new(Options { device: device.map(str::to_owned), validation, ..Options::default() })?;
    if demanded {
        let mut watched = WATCHED.lock().unwrap_or_else(PoisonError::into_inner);
        watched.extend(device.messages().cloned());
    }
    Ok(device)
}

/// To be asked when a command has ended and its devices are gone: an error if the layer has said anything.
///
/// # Errors
/// [`Error::InvalidParam`]; each message is on standard error.
pub fn verdict() -> Result<()> {
    let watched = WATCHED.lock().unwrap_or_else(PoisonError::into_inner);
    let messages: Vec<_> = watched.iter().flat_map(Messages::all).collect();
    messages.iter().for_each(|message| note(&format!("validation: {message}")));
    match messages.len() {
        0 => Ok(()),
        n => Err(Error::invalid(VARIABLE, n, "no message from the validation layer")),
    }
}
