//! Test volumes of many kinds for tests of hits, traced through bricks and through boxes.

use std::sync::Arc;

use pumice_core::CompressedVolume;
use pumice_cpu::traverse::{SceneTracer, TracedInstance};
use pumice_oracle::Dense;
use pumice_oracle::volumes::{blobs, checkerboard, noise, sheets};
use pumice_transport::RenderError;

use super::volumes::neurites;

/// Builds a tracer for the same instances: with bricks, or with the hierarchy alone.
pub type Make = fn(&[TracedInstance]) -> Result<SceneTracer, RenderError>;
pub const MAKES: [(&str, Make); 2] = [("bricks", SceneTracer::new), ("boxes", SceneTracer::without_bricks)];

/// From nearly empty to full, with and without large solids; and real neurites.
pub fn volumes() -> Vec<(&'static str, Dense, Arc<CompressedVolume>)> {
    let named = |name, (dense, compressed)| (name, dense, compressed);
    vec![
        named("noise 0.1 %", noise([70, 61, 83], 0.001, 9, 1)),
        named("noise 3 %", noise([64, 64, 64], 0.03, 4, 2)),
        named("noise 50 %", noise([37, 50, 41], 0.5, 3, 3)),
        named("checkerboard", checkerboard([33, 34, 35])),
        named("sheets", sheets([66, 70, 50])),
        named("blobs", blobs([64, 64, 64], 60, 12, 4)),
        named("neurites", neurites()),
    ]
}

/// Each volume with each way of building a tracer.
pub fn volumes_both_ways() -> impl Iterator<Item = (String, Dense, Arc<CompressedVolume>, Make)> {
    volumes().into_iter().flat_map(|(name, dense, compressed)| {
        MAKES.map(|(way, make)| (format!("{name}, {way}"), dense.clone(), Arc::clone(&compressed), make))
    })
}
