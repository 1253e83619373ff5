//! Identity of resources.

use std::sync::atomic::{AtomicU64, Ordering};

/// A number that no other resource of this process has.
pub(crate) fn next_id() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(1, Ordering::Relaxed)
}
