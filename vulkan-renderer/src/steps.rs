//! A compute shader that does one of several steps for each item of a picture, in launches that are kept as short as those of samples.

use std::time::Duration;

use crate::device::{Buffer, ComputePipeline, DeviceError, Gpu};
use crate::layout::Launch;
use crate::slices::{Cursor, Slices, Tile};

/// Workgroup size of such shaders, across and down.
const GROUP: u32 = 8;

/// The compiled shader, and launch sizes of its steps, which differ in cost.
#[derive(Debug)]
pub(crate) struct Steps<const N: usize> {
    pub(crate) gpu: Gpu,
    pipeline: ComputePipeline,
    during: &'static str,
    slices: [Slices; N],
}

impl<const N: usize> Steps<N> {
    /// Compiles the shader; `during` names its launches in errors.
    pub(crate) fn new(gpu: &Gpu, words: &[u32], during: &'static str) -> Result<Self, DeviceError> {
        let pipeline = gpu.compute_pipeline(words, &[])?;
        Ok(Self { gpu: gpu.clone(), pipeline, during, slices: [Slices::default(); N] })
    }

    /// Makes launches smaller, after memory was short or the device was lost.
    pub(crate) fn shrink(&mut self) {
        self.slices.iter_mut().for_each(|slices| {
            slices.shrink();
        });
    }

    /// Does a step for the items of a tile.
    pub(crate) fn launch(&self, header: &Buffer, step: usize, tile: &Tile) -> Result<Duration, DeviceError> {
        let launch = Launch { input: header.address(), wanted: step as u32, ..tile.launch() };
        let groups = [tile.width, tile.height].map(|n| n.div_ceil(GROUP));
        self.gpu.dispatch(self.during, &self.pipeline, &launch, groups)
    }

    /// Does a step for all items of a picture of so many across and down.
    pub(crate) fn run(&mut self, header: &Buffer, step: usize, size: [u32; 2]) -> Result<(), DeviceError> {
        let mut at = Cursor::default();
        while let Some((tile, after)) = self.slices[step].next(size, at, 1) {
            let taken = self.launch(header, step, &tile)?;
            self.slices[step].learn(tile.pixels(), 1, taken.as_secs_f64());
            at = after;
        }
        Ok(())
    }
}
