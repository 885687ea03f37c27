//! Ray tracing pipelines: a ray generation shader, a miss shader, one hit group with an intersection shader, and the shader binding table
//! that refers to them.
//!
//! ```text
//! table:  │ ray generation │ miss │ hit group │      each at a multiple of shaderGroupBaseAlignment, without data
//! ```

use std::sync::Arc;
use std::time::Duration;

use ash::{khr, vk};

use super::DeviceError;
use super::buffer::Buffer;
use super::compute::{Module, constant_entries, launch_layout};
use super::gpu::{Gpu, Inner};
use crate::layout::Launch;

/// Stages that read the push constants.
const STAGES: vk::ShaderStageFlags = vk::ShaderStageFlags::from_raw(
    vk::ShaderStageFlags::RAYGEN_KHR.as_raw() | vk::ShaderStageFlags::INTERSECTION_KHR.as_raw(),
);

/// Shaders of a pipeline, as SPIR-V words.
#[derive(Clone, Copy, Debug)]
pub struct RayShaders<'a> {
    /// The ray generation shader.
    pub generation: &'a [u32],
    /// The miss shader, which runs for a ray that met nothing.
    pub miss: &'a [u32],
    /// The intersection shader, which tests the contents of a box.
    pub intersection: &'a [u32],
}

/// A ray tracing pipeline with its shader binding table.
pub struct RayPipeline {
    layout: vk::PipelineLayout,
    pub(super) pipeline: vk::Pipeline,
    /// None only while the pipeline is being made.
    table: Option<Buffer>,
    regions: [vk::StridedDeviceAddressRegionKHR; 3],
    gpu: Arc<Inner>,
}

impl Gpu {
    /// Creates a ray tracing pipeline; `constants[i]` is specialisation constant i of every shader that has it.
    ///
    /// # Errors
    /// When the driver refuses it or memory is short.
    pub fn ray_pipeline(
        &self,
        shaders: &RayShaders<'_>,
        constants: &[u32],
    ) -> Result<RayPipeline, DeviceError> {
        let mut made = self.ray_pipeline_alone(shaders, constants)?;
        self.add_table(&mut made)?;
        Ok(made)
    }

    /// The pipeline without its shader binding table, so that nothing is launched.
    pub(super) fn ray_pipeline_alone(
        &self,
        shaders: &RayShaders<'_>,
        constants: &[u32],
    ) -> Result<RayPipeline, DeviceError> {
        let inner = &self.inner;
        let calls = self.ray_calls()?;
        let modules = [shaders.generation, shaders.miss, shaders.intersection]
            .map(|words| Module::new(self, words, constants));
        let [generation, miss, intersection] = modules;
        let (generation, miss, intersection) = (generation?, miss?, intersection?);
        let entries = constant_entries(constants);
        let specialization =
            vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(constants));
        let stage = |stage, module: &Module| {
            vk::PipelineShaderStageCreateInfo::default()
                .stage(stage)
                .module(module.handle)
                .name(c"main")
                .specialization_info(&specialization)
        };
        let stages = [
            stage(vk::ShaderStageFlags::RAYGEN_KHR, &generation),
            stage(vk::ShaderStageFlags::MISS_KHR, &miss),
            stage(vk::ShaderStageFlags::INTERSECTION_KHR, &intersection),
        ];
        let unused = vk::RayTracingShaderGroupCreateInfoKHR::default()
            .general_shader(vk::SHADER_UNUSED_KHR)
            .closest_hit_shader(vk::SHADER_UNUSED_KHR)
            .any_hit_shader(vk::SHADER_UNUSED_KHR)
            .intersection_shader(vk::SHADER_UNUSED_KHR);
        let groups = [
            unused.ty(vk::RayTracingShaderGroupTypeKHR::GENERAL).general_shader(0),
            unused.ty(vk::RayTracingShaderGroupTypeKHR::GENERAL).general_shader(1),
            unused.ty(vk::RayTracingShaderGroupTypeKHR::PROCEDURAL_HIT_GROUP).intersection_shader(2),
        ];
        let mut made = RayPipeline {
            layout: launch_layout(inner, STAGES)?,
            pipeline: vk::Pipeline::null(),
            table: None,
            regions: [vk::StridedDeviceAddressRegionKHR::default(); 3],
            gpu: Arc::clone(inner),
        };
        let create = [vk::RayTracingPipelineCreateInfoKHR::default()
            .flags(inner.pipeline_flags())
            .stages(&stages)
            .groups(&groups)
            .max_pipeline_ray_recursion_depth(1)
            .layout(made.layout)];
        let deferred = vk::DeferredOperationKHR::null();
        // SAFETY: all that `create` points to lives until the call returns; the features were enabled.
        let pipelines =
            unsafe { calls.create_ray_tracing_pipelines(deferred, inner.cache.handle, &create, None) }
                .map_err(|(_, e)| DeviceError::of("vkCreateRayTracingPipelinesKHR")(e))?;
        made.pipeline = pipelines.first().copied().unwrap_or_default();
        Ok(made)
    }

    /// Makes the shader binding table of a pipeline.
    fn add_table(&self, made: &mut RayPipeline) -> Result<(), DeviceError> {
        let (inner, calls) = (&self.inner, self.ray_calls()?);
        // Each region begins at a multiple of the base alignment, and the size of its only entry is a multiple of
        // the handle alignment.
        let limits = inner.limits;
        let entry = limits.handle_bytes.next_multiple_of(limits.handle_alignment);
        let region = entry.next_multiple_of(limits.table_alignment);
        let handle_bytes = limits.handle_bytes as usize;
        // SAFETY: three groups of handles of that size.
        let handles =
            unsafe { calls.get_ray_tracing_shader_group_handles(made.pipeline, 0, 3, 3 * handle_bytes) }
                .map_err(DeviceError::of("vkGetRayTracingShaderGroupHandlesKHR"))?;
        let usage = vk::BufferUsageFlags::SHADER_BINDING_TABLE_KHR;
        let table = self.buffer_for("a table of shaders", 3 * region + limits.table_alignment, usage)?;
        let start = table.address().next_multiple_of(limits.table_alignment);
        let mut bytes = vec![0; 3 * region as usize];
        for (i, handle) in handles.chunks_exact(handle_bytes).enumerate() {
            bytes[i * region as usize..][..handle_bytes].copy_from_slice(handle);
        }
        self.upload(&table, start - table.address(), &bytes)?;
        made.regions = [0, 1, 2].map(|i| {
            vk::StridedDeviceAddressRegionKHR::default()
                .device_address(start + i * region)
                .stride(entry)
                .size(entry)
        });
        made.table = Some(table);
        Ok(())
    }

    /// Runs a ray tracing pipeline over `size` rays and waits for its end. Returns how long that took.
    ///
    /// # Errors
    /// [`DeviceError::Lost`]; [`DeviceError::Limit`] for more rays than the device takes at once.
    pub fn trace(
        &self,
        during: &'static str,
        pipeline: &RayPipeline,
        launch: &Launch,
        size: [u32; 2],
    ) -> Result<Duration, DeviceError> {
        let calls = self.ray_calls()?;
        let (needed, limit) = (u64::from(size[0]) * u64::from(size[1]), self.inner.limits.ray_count);
        if needed > limit {
            return Err(DeviceError::Limit { what: "rays of a launch", needed, limit });
        }
        self.submit(during, |inner, commands| {
            let [generation, miss, hit] = &pipeline.regions;
            let none = vk::StridedDeviceAddressRegionKHR::default();
            let bind = vk::PipelineBindPoint::RAY_TRACING_KHR;
            // SAFETY: pipeline and table live until the launch has ended; the push constants are as the layout says. What the
            // shaders read and write by address is alive as the module promises.
            unsafe {
                inner.calls.cmd_bind_pipeline(commands, bind, pipeline.pipeline);
                inner.calls.cmd_push_constants(
                    commands,
                    pipeline.layout,
                    STAGES,
                    0,
                    bytemuck::bytes_of(launch),
                );
                calls.cmd_trace_rays(commands, generation, miss, hit, &none, size[0], size[1], 1);
            }
        })
    }

    fn ray_calls(&self) -> Result<&khr::ray_tracing_pipeline::Device, DeviceError> {
        self.inner.ray_pipeline.as_ref().ok_or_else(|| DeviceError::Unsupported {
            backend: self.backend(),
            why: "the device was opened without ray tracing pipelines".into(),
        })
    }
}

impl Drop for RayPipeline {
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

impl std::fmt::Debug for RayPipeline {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RayPipeline").field("table", &self.table).finish()
    }
}
