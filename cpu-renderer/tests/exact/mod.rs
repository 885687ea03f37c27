//! Oracles of traversal: in whole numbers on a grid (the crate `pumice-oracle`), in rational numbers for any placement (here).
#![allow(dead_code, unreachable_pub, unused_imports, reason = "each test file uses its part")]

pub mod cases;
pub mod rational;
pub mod volumes;

pub use pumice_oracle::*;
