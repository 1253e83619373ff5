//! The multiple scattering of the homogeneous ball, solved order by order of angular momentum. Derivation: `docs/tables.md`.

pub mod basis;
pub mod device;
pub mod grid;
pub mod krylov;
pub mod plan;
