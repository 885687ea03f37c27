//! What a driver's compiler counts in the shaders that it made: registers, spills, instructions (`VK_KHR_pipeline_executable_properties`).
//!
//! Names and units are each driver's own. A pipeline has an executable for each shader, or one for several.

use std::time::{Duration, Instant};

use ash::vk;

use super::compute::ComputePipeline;
use super::gpu::{Gpu, Inner};
use super::ray_pipeline::RayPipeline;
use super::{DeviceError, RayShaders};

/// A number that a driver tells of an executable.
#[derive(Clone, Debug, PartialEq)]
pub struct Statistic {
    /// The driver's name for it.
    pub name: String,
    /// Its value. Truth is 1.
    pub value: f64,
}

/// Compiled code of one shader, or of several together.
#[derive(Clone, Debug, PartialEq)]
pub struct Executable {
    /// The driver's name for it.
    pub name: String,
    /// Threads that run in step; 0 where the driver does not tell.
    pub subgroup_size: u32,
    /// What the driver counts.
    pub statistics: Vec<Statistic>,
}

impl Inner {
    /// Flags of every pipeline.
    pub(super) fn pipeline_flags(&self) -> vk::PipelineCreateFlags {
        match self.executables {
            Some(_) => vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR,
            None => vk::PipelineCreateFlags::empty(),
        }
    }
}

impl Gpu {
    /// Compiles a compute shader, and launches nothing. Returns the time that it took, and what the compiler counted.
    ///
    /// # Errors
    /// When the driver refuses it, or the device was not opened for statistics.
    pub fn compute_executables(
        &self,
        words: &[u32],
        constants: &[u32],
    ) -> Result<(Duration, Vec<Executable>), DeviceError> {
        let start = Instant::now();
        let made: ComputePipeline = self.compute_pipeline(words, constants)?;
        Ok((start.elapsed(), self.executables_of(made.pipeline)?))
    }

    /// As [`Gpu::compute_executables`], of a ray tracing pipeline.
    ///
    /// # Errors
    /// When the driver refuses it, or the device was not opened for statistics.
    pub fn ray_executables(
        &self,
        shaders: &RayShaders<'_>,
        constants: &[u32],
    ) -> Result<(Duration, Vec<Executable>), DeviceError> {
        let start = Instant::now();
        let made: RayPipeline = self.ray_pipeline_alone(shaders, constants)?;
        Ok((start.elapsed(), self.executables_of(made.pipeline)?))
    }

    fn executables_of(&self, pipeline: vk::Pipeline) -> Result<Vec<Executable>, DeviceError> {
        let calls = self.inner.executables.as_ref().ok_or_else(|| DeviceError::Unsupported {
            backend: self.backend(),
            why: "the device was not opened for statistics".into(),
        })?;
        let info = vk::PipelineInfoKHR::default().pipeline(pipeline);
        // SAFETY: the pipeline is of this device, was made to keep its statistics and outlives the calls, here and below.
        let properties = unsafe { calls.get_pipeline_executable_properties(&info) }
            .map_err(DeviceError::of("vkGetPipelineExecutablePropertiesKHR"))?;
        let mut executables = Vec::with_capacity(properties.len());
        for (i, one) in (0..).zip(&properties) {
            let info = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline).executable_index(i);
            // SAFETY: as above; the index is one of those that were listed.
            let statistics = unsafe { calls.get_pipeline_executable_statistics(&info) }
                .map_err(DeviceError::of("vkGetPipelineExecutableStatisticsKHR"))?;
            executables.push(Executable {
                name: text(one.name_as_c_str()),
                subgroup_size: one.subgroup_size,
                statistics: statistics
                    .iter()
                    .map(|s| Statistic { name: text(s.name_as_c_str()), value: value(s) })
                    .collect(),
            });
        }
        Ok(executables)
    }
}

fn text(text: Result<&std::ffi::CStr, std::ffi::FromBytesUntilNulError>) -> String {
    text.map_or_else(|_| String::new(), |t| t.to_string_lossy().into_owned())
}

fn value(statistic: &vk::PipelineExecutableStatisticKHR<'_>) -> f64 {
    use vk::PipelineExecutableStatisticFormatKHR as Format;
    // SAFETY: the format says which member the driver has written; all are plain numbers.
    unsafe {
        match statistic.format {
            Format::BOOL32 => f64::from(u32::from(statistic.value.b32 != 0)),
            Format::INT64 => statistic.value.i64 as f64,
            Format::UINT64 => statistic.value.u64 as f64,
            _ => statistic.value.f64,
        }
    }
}
