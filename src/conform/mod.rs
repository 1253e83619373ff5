//! What a driver must do for Welkin, as a matrix of checks: `welkin conform` prints it, a driver's people read it.
//!
//! [`checks`] is the table; [`Lab`] is a device to try them on; [`Check::run`] tries one. A check passes, fails with what was
//! expected and what was found, or is skipped with the reason. A message of the validation layer fails the check that
//! provoked it.
//!
//! ```no_run
//! # fn main() -> welkin::Result<()> {
//! use welkin::conform::{self, Effort, Lab, LabOptions, Verdict};
//! let mut lab = Lab::open(LabOptions { effort: Effort::Quick, ..LabOptions::default() })?;
//! for check in conform::checks() {
//!     let outcome = check.run(&mut lab);
//!     if let Verdict::Fail { expected, found } = &outcome.verdict {
//!         println!("{}: expected {expected}, found {found}", check.id);
//!     }
//!     if outcome.device_failed {
//!         lab = lab.reopen()?; // a lost device is not used again
//!     }
//! }
//! # Ok(())
//! # }
//! ```
//!
//! A software rasterizer runs one pixel's fragments in order even where nobody asked for it, so on such a driver no picture
//! can show a missing interlock. Every check of ordering therefore also looks at what it gives the driver: the SPIR-V
//! (`OpBeginInvocationInterlockEXT` and its end once, at the top level of the entry point, with the execution mode) and the
//! flags of pipeline and subpass. On hardware that runs fragments side by side the pictures prove it too.

mod attachment;
mod beyond;
mod blocks;
mod glob;
mod images;
mod interlock;
mod lab;
mod merges;
mod spirv;
mod stack;
mod statics;
mod variant;

use crate::{Error, Result};
use std::time::Instant;

pub use glob::matches;
pub use lab::{Abilities, Effort, Lab, LabOptions, Need, Sabotage};
pub use spirv::{Instruction, Interlock, Section, Spirv};

/// How a check ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// As it must be; with what was tried or measured, in words.
    Pass(String),
    /// Not as it must be.
    Fail {
        /// What it should have been.
        expected: String,
        /// What it was.
        found: String,
    },
    /// Not tried, and why.
    Skip(String),
}

impl Verdict {
    /// A failure.
    pub fn fail(expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self::Fail { expected: expected.into(), found: found.into() }
    }
}

/// What became of a check.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// How it ended.
    pub verdict: Verdict,
    /// How long it took [s].
    pub seconds: f64,
    /// Warnings and errors of the validation layer; any is a failure.
    pub validation: Vec<String>,
    /// A Vulkan call failed: the lab must not be used any more (see [`Lab::reopen`]).
    pub device_failed: bool,
}

/// A step of a check: a verdict ends it early, an error the use of the device too.
type Step<T> = Result<Result<T, Verdict>>;

type Run = dyn Fn(&mut Lab) -> Result<Verdict> + Send + Sync;

/// One row of the matrix.
pub struct Check {
    /// Name, dots between its parts. Stable: a later version adds checks, and does not rename or remove any.
    pub id: String,
    /// What of Welkin it belongs to.
    pub group: Group,
    /// What is done, and what must come of it.
    pub what: String,
    /// Why Welkin needs it.
    pub why: &'static str,
    /// Where it is written that it must be so.
    pub spec: &'static str,
    /// What a device must have for the check to make sense.
    pub needs: Vec<Need>,
    /// What, broken on purpose, must make it fail.
    pub fails_by: Vec<Sabotage>,
    run: Box<Run>,
}

/// Parts of the matrix.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Group {
    /// What Welkin's own shaders ask for, as compiled; needs no device.
    Static,
    /// Fragment shader interlock.
    Interlock,
    /// Rasterization-order attachment access.
    Attachment,
    /// Building blocks of every mode.
    Blocks,
    /// Pictures of the blend modes.
    Images,
}

impl Group {
    /// Every group, in the order of the matrix.
    pub const ALL: [Self; 5] = [Self::Static, Self::Interlock, Self::Attachment, Self::Blocks, Self::Images];

    /// Name, as the ids of its checks begin.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Static => "static",
            Self::Interlock => "interlock",
            Self::Attachment => "attachment",
            Self::Blocks => "blocks",
            Self::Images => "images",
        }
    }

    /// What it is about, in a line.
    #[must_use]
    pub fn about(self) -> &'static str {
        match self {
            Self::Static => "what Welkin's own shaders ask for, as compiled",
            Self::Interlock => "fragment shader interlock: order, exclusion and visibility within a pixel",
            Self::Attachment => "rasterization-order attachment access: the same by reading attachments back",
            Self::Blocks => "building blocks of every mode",
            Self::Images => "pictures of the blend modes against the exact oracle",
        }
    }
}

impl Check {
    /// A check of `group` called `group.name`.
    pub fn new(
        group: Group,
        name: impl AsRef<str>,
        what: impl Into<String>,
        run: impl Fn(&mut Lab) -> Result<Verdict> + Send + Sync + 'static,
    ) -> Self {
        Self {
            id: format!("{}.{}", group.name(), name.as_ref()),
            group,
            what: what.into(),
            why: "",
            spec: "",
            needs: Vec::new(),
            fails_by: Vec::new(),
            run: Box::new(run),
        }
    }

    /// Says why Welkin needs it.
    #[must_use]
    pub fn why(mut self, why: &'static str) -> Self {
        self.why = why;
        self
    }

    /// Says where it is specified.
    #[must_use]
    pub fn spec(mut self, spec: &'static str) -> Self {
        self.spec = spec;
        self
    }

    /// Says what a device must have.
    #[must_use]
    pub fn needs(mut self, needs: impl IntoIterator<Item = Need>) -> Self {
        self.needs.extend(needs);
        self
    }

    /// Says what, broken on purpose, must make it fail: a test holds it to that.
    #[must_use]
    pub fn fails_by(mut self, sabotages: impl IntoIterator<Item = Sabotage>) -> Self {
        self.fails_by.extend(sabotages);
        self
    }

    /// Tries it.
    pub fn run(&self, lab: &mut Lab) -> Outcome {
        let start = Instant::now();
        let before = lab.messages().len();
        let lacking = self.needs.iter().find_map(|need| lab.abilities().lacks(*need));
        let (mut verdict, device_failed) = match lacking {
            Some(reason) => (Verdict::Skip(reason), false),
            None => match (self.run)(lab) {
                Ok(verdict) => (verdict, false),
                Err(error) => (failure(&error), true),
            },
        };
        let validation = lab.messages().split_off(before);
        if let Some(message) = validation.first() {
            verdict = match verdict {
                fail @ Verdict::Fail { .. } => fail,
                _ => Verdict::fail(
                    "no message of the validation layer",
                    format!("{}, first: {message}", count(validation.len(), "message")),
                ),
            };
        }
        Outcome { verdict, seconds: start.elapsed().as_secs_f64(), validation, device_failed }
    }
}

fn failure(error: &Error) -> Verdict {
    Verdict::fail("every Vulkan call to succeed", error.to_string())
}

/// `1 message`, `2 messages`.
fn count(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

/// The matrix, in the order in which it is tried and printed.
#[must_use]
pub fn checks() -> Vec<Check> {
    let mut list = Vec::new();
    statics::add(&mut list);
    interlock::add(&mut list);
    beyond::add(&mut list);
    attachment::add(&mut list);
    blocks::add(&mut list);
    images::add(&mut list);
    list
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn every_row_says_what_it_checks_why_and_where_it_is_written() {
        let mut ids = HashSet::new();
        for check in checks() {
            assert!(ids.insert(check.id.clone()), "{} is there twice", check.id);
            let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || ".-".contains(c);
            assert!(check.id.chars().all(plain), "{}", check.id);
            for (text, name) in [(check.what.as_str(), "what"), (check.why, "why"), (check.spec, "spec")] {
                assert!(text.len() > 5, "{}: {name} is missing", check.id);
            }
            assert!(!check.fails_by.is_empty(), "{}: nothing makes it fail", check.id);
        }
    }

    #[test]
    fn groups_stay_together() {
        let order: Vec<_> = checks().iter().map(|c| Group::ALL.iter().position(|g| *g == c.group)).collect();
        assert!(order.is_sorted(), "{order:?}");
    }
}
