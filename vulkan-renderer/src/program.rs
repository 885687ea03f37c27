//! One entry point on one backend. It hides from callers which of the three ways to trace rays is used.
//!
//! ```text
//! compute, ray query     groups of shader invocations, as many as cover the items
//! ray tracing pipeline   one ray of the launch for each item, and scratch memory for the search state of each (`layout::SCRATCH_BYTES`)
//! ```

use std::time::Duration;

use crate::device::{Backend, Buffer, ComputePipeline, DeviceError, Gpu, RayPipeline, RayShaders};
use crate::layout::{Launch, SCRATCH_BYTES};

/// The SPIR-V of an entry point, as words.
#[derive(Clone, Copy, Debug)]
pub struct Code<'a> {
    /// A compute shader, or a ray generation shader.
    pub main: &'a [u32],
    /// The other shaders of a ray tracing pipeline: the miss shader and the intersection shader.
    pub miss_and_box: Option<[&'a [u32]; 2]>,
    /// Workgroup size of a compute shader, across and down; 1 for a ray generation shader.
    pub group: [u32; 2],
}

/// An entry point that is ready to be launched on one device.
#[derive(Debug)]
pub struct Program {
    made: Made,
    group: [u32; 2],
    gpu: Gpu,
}

#[derive(Debug)]
enum Made {
    Compute(ComputePipeline),
    Rays { pipeline: RayPipeline, scratch: Option<Buffer> },
}

impl Program {
    /// Creates the pipeline of an entry point; `constants[i]` is specialisation constant i.
    ///
    /// # Errors
    /// When the driver refuses it, memory is short, or the code is not for the device's backend.
    pub fn new(gpu: &Gpu, code: &Code<'_>, constants: &[u32]) -> Result<Self, DeviceError> {
        let made = match (gpu.backend(), code.miss_and_box) {
            (Backend::RayPipeline, Some([miss, intersection])) => {
                let shaders = RayShaders { generation: code.main, miss, intersection };
                Made::Rays { pipeline: gpu.ray_pipeline(&shaders, constants)?, scratch: None }
            }
            (Backend::RayQuery | Backend::Compute, None) => {
                Made::Compute(gpu.compute_pipeline(code.main, constants)?)
            }
            (backend, _) => {
                let why = "the shaders are those of another backend".into();
                return Err(DeviceError::Unsupported { backend, why });
            }
        };
        Ok(Self { made, group: code.group, gpu: gpu.clone() })
    }

    /// Runs it over `items` across and down, and waits for its end. Returns how long that took. Sets `launch.scratch` itself.
    ///
    /// # Errors
    /// [`DeviceError::OutOfMemory`] for the scratch memory; [`DeviceError::Lost`]; [`DeviceError::Limit`] for more items than
    /// the device takes at once.
    pub fn run(
        &mut self,
        during: &'static str,
        launch: &Launch,
        items: [u32; 2],
    ) -> Result<Duration, DeviceError> {
        let gpu = &self.gpu;
        match &mut self.made {
            Made::Compute(pipeline) => {
                let groups = [0, 1].map(|a| items[a].div_ceil(self.group[a].max(1)));
                gpu.dispatch(during, pipeline, launch, groups)
            }
            Made::Rays { pipeline, scratch } => {
                let needed = (u64::from(items[0]) * u64::from(items[1])).saturating_mul(SCRATCH_BYTES);
                let held = match scratch.take() {
                    Some(held) if held.bytes() >= needed => held,
                    former => {
                        // Free the former memory first; the new allocation may need it.
                        drop(former);
                        gpu.buffer("the rays' scratch memory", needed)?
                    }
                };
                let address = scratch.insert(held).address();
                gpu.trace(during, pipeline, &Launch { scratch: address, ..*launch }, items)
            }
        }
    }

    /// Frees the scratch memory; the next launch allocates it again.
    pub(crate) fn drop_scratch(&mut self) {
        if let Made::Rays { scratch, .. } = &mut self.made {
            *scratch = None;
        }
    }

    /// Bytes of scratch memory on the device.
    pub fn scratch_bytes(&self) -> u64 {
        match &self.made {
            Made::Rays { scratch: Some(scratch), .. } => scratch.bytes(),
            _ => 0,
        }
    }
}
