//! Checks shared by the parameter structs. A NaN is inside no range, so every check refuses it.

use std::fmt::{Debug, Display};
use std::ops::RangeInclusive;

use crate::{Error, Result};

/// `value` is inside `range`; `unit` follows the range in the message.
pub fn within<T: PartialOrd + Display + Debug>(
    field: &str,
    value: T,
    range: RangeInclusive<T>,
    unit: &str,
) -> Result<()> {
    if range.contains(&value) {
        return Ok(());
    }
    let space = if unit.is_empty() { "" } else { " " };
    Err(Error::invalid(field, value, format!("a number from {:?} to {:?}{space}{unit}", range.start(), range.end())))
}

/// `value` is above 0 and at most `most`.
pub fn positive<T: PartialOrd + Display + Debug + Default>(field: &str, value: T, most: T, unit: &str) -> Result<()> {
    if value > T::default() && value <= most {
        return Ok(());
    }
    let space = if unit.is_empty() { "" } else { " " };
    Err(Error::invalid(field, value, format!("a number above 0 and at most {most:?}{space}{unit}")))
}

/// Each component of `value` is inside `range`; the field in the message carries the component's index.
pub fn each_within<T, const N: usize>(field: &str, value: [T; N], range: RangeInclusive<T>, unit: &str) -> Result<()>
where
    T: PartialOrd + Display + Debug + Clone,
{
    for (index, component) in value.into_iter().enumerate() {
        within(&format!("{field}[{index}]"), component, range.clone(), unit)?;
    }
    Ok(())
}

/// The largest distance from the world's origin that a position may have, per axis [m]. Beyond it the planet is flat to no
/// useful approximation.
pub const MAX_COORDINATE: f64 = 1.0e7;
