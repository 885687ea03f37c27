//! Each shader function against its twin on the CPU, on random inputs.
//!
//! Where both compute in whole numbers, in emulated doubles or in floats whose operations Vulkan rounds correctly (sums, products:
//! `precise`), the bits must be equal. Elsewhere the tolerance stands beside the test, with its reason.

#![allow(clippy::expect_used, clippy::panic, reason = "tests")]

mod gpu;

#[path = "twins/doubles.rs"]
mod doubles;
#[path = "twins/emission.rs"]
mod emission;
#[path = "twins/geometry.rs"]
mod geometry;
#[path = "twins/lighting.rs"]
mod lighting;
#[path = "twins/points.rs"]
mod points;
#[path = "twins/scattering.rs"]
mod scattering;
#[path = "twins/words.rs"]
mod words;
