//! What recording assumes about the device once its commands have run, and how to take back what was never submitted.

use super::Recorder;
use crate::Result;
use crate::gpu::access::{Access, Barrier, ResourceState};
use crate::gpu::id::next_id;
use std::collections::{HashMap, HashSet};

/// Commands that need to be recorded once, as those that fill a table: [`Recorder::once`], [`Recorder::refresh`].
#[derive(Debug)]
pub struct Once(u64);

impl Once {
    /// Not recorded yet.
    #[must_use]
    pub fn new() -> Self {
        Self(next_id())
    }
}

impl Default for Once {
    fn default() -> Self {
        Self::new()
    }
}

/// What is tracked from frame to frame, with a journal of the changes since [`Self::begin`].
#[derive(Default)]
pub(super) struct Tracked {
    resources: HashMap<u64, ResourceState>,
    /// Images in the layout that recording expects.
    initialised: HashSet<u64>,
    /// Inputs of what has been recorded, as bits.
    recorded: HashMap<u64, Vec<u32>>,
    journal: Vec<Change>,
}

/// What was there before a change.
enum Change {
    Resource(u64, Option<ResourceState>),
    Initialised(u64, bool),
    Recorded(u64, Option<Vec<u32>>),
}

impl Tracked {
    /// What was recorded so far has been submitted, or will be.
    pub(super) fn begin(&mut self) {
        self.journal.clear();
    }

    /// Takes back everything since [`Self::begin`], the latest first.
    pub(super) fn roll_back(&mut self) {
        while let Some(change) = self.journal.pop() {
            match change {
                Change::Resource(id, Some(before)) => drop(self.resources.insert(id, before)),
                Change::Resource(id, None) => drop(self.resources.remove(&id)),
                Change::Initialised(id, true) => drop(self.initialised.insert(id)),
                Change::Initialised(id, false) => drop(self.initialised.remove(&id)),
                Change::Recorded(id, Some(before)) => drop(self.recorded.insert(id, before)),
                Change::Recorded(id, None) => drop(self.recorded.remove(&id)),
            }
        }
    }

    /// Forgets the accesses, when the device is idle: nothing has to wait for them.
    pub(super) fn forget_accesses(&mut self) {
        self.resources.clear();
        self.journal.retain(|change| !matches!(change, Change::Resource(..)));
    }

    /// Applies `access` to resource `id` and adds to `barrier` what must come before it.
    pub(super) fn apply(&mut self, id: u64, access: Access, barrier: &mut Barrier) {
        let before = self.resources.get(&id).copied();
        let state = self.resources.entry(id).or_default();
        state.apply(access, barrier);
        self.journal.push(Change::Resource(id, before));
    }

    /// Sets whether image `id` is in the layout that recording expects; whether that changed.
    pub(super) fn set_initialised(&mut self, id: u64, initialised: bool) -> bool {
        let changed = if initialised { self.initialised.insert(id) } else { self.initialised.remove(&id) };
        if changed {
            self.journal.push(Change::Initialised(id, !initialised));
        }
        changed
    }

    /// Nothing has to wait for what was done to `id`.
    pub(super) fn reset(&mut self, id: u64) {
        let before = self.resources.remove(&id);
        self.journal.push(Change::Resource(id, before));
    }
}

impl Recorder<'_> {
    /// Calls `record` unless that has been done before, in this frame or one that was submitted.
    pub fn once(&mut self, once: &Once, record: impl FnOnce(&mut Self) -> Result<()>) -> Result<()> {
        self.refresh(once, &[], record)
    }

    /// Calls `record` unless it was last called for the same `inputs`, in this frame or one that was submitted.
    pub fn refresh(&mut self, once: &Once, inputs: &[f32], record: impl FnOnce(&mut Self) -> Result<()>) -> Result<()> {
        let bits = || inputs.iter().map(|input| input.to_bits());
        if self.state.tracked.recorded.get(&once.0).is_some_and(|last| last.iter().copied().eq(bits())) {
            return Ok(());
        }
        record(self)?;
        let tracked = &mut self.state.tracked;
        let before = tracked.recorded.insert(once.0, bits().collect());
        tracked.journal.push(Change::Recorded(once.0, before));
        Ok(())
    }
}
