//! The `welkin` program.

fn main() {}
