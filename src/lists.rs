//! Lists on the device that grow with the need, as the host sees them.

/// Size of a list and what the last frame wanted of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ListUse {
    /// Name of the list.
    pub name: &'static str,
    /// Elements wanted.
    pub needed: u32,
    /// Elements that fit.
    pub capacity: u32,
}

/// A quarter more than needed, so that a slowly growing need does not reallocate every frame.
pub(crate) fn grown(needed: u32) -> u32 {
    needed.saturating_add(needed / 4).saturating_add(64)
}
