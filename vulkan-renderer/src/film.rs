//! The film on the device, and how far its samples have come.
//!
//! Sums are those of [`FilmBuffer`]: three floats for each replicate of each pixel, rows from the top. A pass brings every pixel
//! from `spp` samples to `target`, launch by launch. A pass that was cancelled is continued by the next one, so each pixel gets
//! each of its samples once and in order, and the picture does not depend on how it was cut.

use pumice_render::FilmBuffer;
use pumice_render::film::STRIDE;
use pumice_render::sampler::REPLICATES;

use crate::device::{Buffer, DeviceError, Gpu};
use crate::slices::Cursor;

/// See the module.
#[derive(Debug)]
pub(crate) struct Film {
    pub(crate) sums: Buffer,
    pub(crate) size: [u32; 2],
    /// Samples that every pixel has.
    pub(crate) spp: u32,
    /// The pass under way: the samples that it brings pixels to, and where it is.
    pub(crate) pass: Option<(u32, Cursor)>,
}

impl Film {
    pub(crate) fn new(gpu: &Gpu, size: [u32; 2]) -> Result<Self, DeviceError> {
        let bytes = u64::from(size[0]) * u64::from(size[1]) * STRIDE as u64 * 4;
        let sums = gpu.buffer("the film", bytes)?;
        gpu.clear(&sums)?;
        Ok(Self { sums, size, spp: 0, pass: None })
    }

    /// Takes all samples away.
    pub(crate) fn clear(&mut self, gpu: &Gpu) -> Result<(), DeviceError> {
        gpu.clear(&self.sums)?;
        (self.spp, self.pass) = (0, None);
        Ok(())
    }

    /// The film as the host sees it.
    pub(crate) fn read(&self, gpu: &Gpu) -> Result<FilmBuffer, DeviceError> {
        let [width, height] = self.size;
        let mut sums = vec![0f32; width as usize * height as usize * STRIDE];
        gpu.download(&self.sums, 0, bytemuck::cast_slice_mut(&mut sums))?;
        let mut rows = vec![self.spp; height as usize];
        if let Some((target, at)) = self.pass {
            rows[..(at.y.min(height)) as usize].fill(target);
            level(&mut sums, width as usize, at, self.spp, target);
        }
        FilmBuffer::from_sums(width, height, sums, rows).ok_or(DeviceError::Limit {
            what: "the film's floats",
            needed: self.sums.bytes() / 4,
            limit: self.sums.bytes() / 4,
        })
    }
}

/// Brings the pixels that a pass has done in the band where it stopped back to the samples of their rows, on average: rows have one
/// number of samples. (The samples themselves are on the device, and the next pass goes on from them.)
fn level(sums: &mut [f32], width: usize, at: Cursor, spp: u32, target: u32) {
    let of = |samples: u32, replicate: u32| (samples + REPLICATES - 1 - replicate) / REPLICATES;
    for row in sums.chunks_mut(width * STRIDE).skip(at.y as usize).take(8) {
        for pixel in row.chunks_exact_mut(STRIDE).take(at.x as usize) {
            for (replicate, sum) in (0..REPLICATES).zip(pixel.chunks_exact_mut(3)) {
                let (has, wanted) = (of(target, replicate), of(spp, replicate));
                let scale = if has == 0 { 0.0 } else { wanted as f32 / has as f32 };
                sum.iter_mut().for_each(|s| *s *= scale);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A constant picture stays constant wherever its pass was stopped.
    #[test]
    fn a_pass_that_was_stopped_keeps_the_mean() {
        let (width, height, spp, target) = (20usize, 24usize, 3u32, 9u32);
        let at = Cursor { x: 11, y: 8 };
        let of = |samples: u32, r: u32| (samples + REPLICATES - 1 - r) / REPLICATES;
        let mut sums = Vec::new();
        let mut rows = Vec::new();
        for y in 0..height {
            rows.push(if y < 8 { target } else { spp });
            for x in 0..width {
                let n = if y < 8 || (y < 16 && x < 11) { target } else { spp };
                for r in 0..REPLICATES {
                    sums.extend([0.5f32, 2.0, 8.0].map(|v| v * of(n, r) as f32));
                }
            }
        }
        let mean_of = |sums: Vec<f32>| {
            FilmBuffer::from_sums(width as u32, height as u32, sums, rows.clone()).unwrap().mean()
        };
        let torn = mean_of(sums.clone());
        assert!(torn.pixels.iter().any(|p| *p != [0.5, 2.0, 8.0]), "the test would see it");
        level(&mut sums, width, at, spp, target);
        assert!(mean_of(sums).pixels.iter().all(|p| *p == [0.5, 2.0, 8.0]));
    }
}
