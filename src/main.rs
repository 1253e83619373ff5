//! The `welkin` program.

#![deny(clippy::unwrap_used, clippy::expect_used)] // Tests and examples may.

fn main() {}
