//! Compares each shader function with its twin on the CPU, on random inputs.
//!
//! Where both compute with whole numbers, emulated doubles, or floats whose operations Vulkan rounds correctly (sums and products that are
//! `precise`), the bits must be equal. Elsewhere the test states its tolerance with the reason.

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
