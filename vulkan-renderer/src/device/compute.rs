//! Creates and runs compute shaders.

use std::sync::Arc;
use std::time::Duration;

use ash::vk;

use super::DeviceError;
use super::gpu::{Gpu, Inner};
use super::initialised::initialised;
use super::specialised::specialised;
use crate::layout::Launch;

/// A compute shader with its specialisation constants.
pub struct ComputePipeline {
    pub(super) layout: vk::PipelineLayout,
    pub(super) pipeline: vk::Pipeline,
    gpu: Arc<Inner>,
}

/// The module of a shader's code, needed only while its pipeline is created.
pub(super) struct Module {
    pub(super) handle: vk::ShaderModule,
    gpu: Arc<Inner>,
}

impl Module {
    /// The module that `words` are, without what the specialisation constants rule out and without variables that hold nothing.
    pub(super) fn new(gpu: &Gpu, words: &[u32], constants: &[u32]) -> Result<Self, DeviceError> {
        let words = specialised(words, constants);
        let words = initialised(&words);
        let words = gpu.inner.float_modes.declared_in(&words);
        let create = vk::ShaderModuleCreateInfo::default().code(&words);
        // SAFETY: the words are a whole module that the compiler made (the build checks them). They use features that were enabled, with
        // execution modes that the device has.
        let handle = unsafe { gpu.inner.calls.create_shader_module(&create, None) }
            .map_err(DeviceError::of("vkCreateShaderModule"))?;
        Ok(Self { handle, gpu: Arc::clone(&gpu.inner) })
    }
}

impl Drop for Module {
    fn drop(&mut self) {
        // SAFETY: pipelines do not need the modules that they were created from.
        unsafe { self.gpu.calls.destroy_shader_module(self.handle, None) };
    }
}

/// Describes an array that holds specialisation constants 0, 1, … in order.
pub(super) fn constant_entries(constants: &[u32]) -> Vec<vk::SpecializationMapEntry> {
    (0..constants.len() as u32)
        .map(|i| vk::SpecializationMapEntry::default().constant_id(i).offset(4 * i).size(4))
        .collect()
}

/// Creates a pipeline layout that has the push constants of a launch alone.
pub(super) fn launch_layout(
    gpu: &Inner,
    stages: vk::ShaderStageFlags,
) -> Result<vk::PipelineLayout, DeviceError> {
    let ranges = [vk::PushConstantRange::default().stage_flags(stages).size(size_of::<Launch>() as u32)];
    let create = vk::PipelineLayoutCreateInfo::default().push_constant_ranges(&ranges);
    // SAFETY: the device is live; every device takes 128 bytes of push constants, and a launch has 64.
    unsafe { gpu.calls.create_pipeline_layout(&create, None) }
        .map_err(DeviceError::of("vkCreatePipelineLayout"))
}

impl Gpu {
    /// Creates a compute pipeline; `constants[i]` is specialisation constant i.
    ///
    /// # Errors
    /// When the driver refuses it.
    pub fn compute_pipeline(&self, words: &[u32], constants: &[u32]) -> Result<ComputePipeline, DeviceError> {
        let module = Module::new(self, words, constants)?;
        let inner = &self.inner;
        let layout = launch_layout(inner, vk::ShaderStageFlags::COMPUTE)?;
        let entries = constant_entries(constants);
        let specialization =
            vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(constants));
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module.handle)
            .name(c"main")
            .specialization_info(&specialization);
        let create = [vk::ComputePipelineCreateInfo::default()
            .flags(inner.pipeline_flags())
            .stage(stage)
            .layout(layout)];
        // SAFETY: all that `create` points to lives until the call returns.
        let made = unsafe { inner.calls.create_compute_pipelines(inner.cache.handle, &create, None) };
        // Takes the layout, so that it is destroyed where the pipeline could not be created.
        let made_of = |pipeline| ComputePipeline { layout, pipeline, gpu: Arc::clone(inner) };
        match made {
            Ok(pipelines) => Ok(made_of(pipelines.first().copied().unwrap_or_default())),
            Err((_, e)) => {
                drop(made_of(vk::Pipeline::null()));
                Err(DeviceError::of("vkCreateComputePipelines")(e))
            }
        }
    }

    /// Runs a compute shader in `groups` workgroups and waits for its end. Returns how long that took.
    ///
    /// # Errors
    /// [`DeviceError::Lost`]; [`DeviceError::Limit`] for more groups than the device takes at once.
    pub fn dispatch(
        &self,
        during: &'static str,
        pipeline: &ComputePipeline,
        launch: &Launch,
        groups: [u32; 2],
    ) -> Result<Duration, DeviceError> {
        for (needed, limit) in groups.into_iter().zip(self.inner.limits.groups) {
            if needed > limit {
                let (needed, limit) = (u64::from(needed), u64::from(limit));
                return Err(DeviceError::Limit { what: "groups of a launch", needed, limit });
            }
        }
        self.submit(during, |inner, commands| {
            // SAFETY: the pipeline lives until the launch has ended; the push constants are as its layout says. What the shader reads and
            // writes by address is alive as the module promises.
            unsafe {
                inner.calls.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, pipeline.pipeline);
                let (stage, bytes) = (vk::ShaderStageFlags::COMPUTE, bytemuck::bytes_of(launch));
                inner.calls.cmd_push_constants(commands, pipeline.layout, stage, 0, bytes);
                inner.calls.cmd_dispatch(commands, groups[0], groups[1], 1);
            }
        })
    }
}

impl Drop for ComputePipeline {
    fn drop(&mut self) {
        if self.gpu.may_destroy() {
            // SAFETY: no launch is in flight; null handles are ignored.
            unsafe {
                self.gpu.calls.destroy_pipeline(self.pipeline, None);
                self.gpu.calls.destroy_pipeline_layout(self.layout, None);
            }
        }
    }
}

impl std::fmt::Debug for ComputePipeline {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("ComputePipeline")
    }
}
