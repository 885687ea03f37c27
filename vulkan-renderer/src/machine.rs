//! A device with what is made for it once: compiled programs, tables that are the same for every scene, and the size of its launches.

use std::path::PathBuf;

use crate::denoise::DenoiseProgram;
use crate::device::{Backend, Buffer, Candidate, DeviceError, Gpu, Instance};
use crate::program::Program;
use crate::programs::Programs;
use crate::resolve::ResolveProgram;
use crate::slices::Slices;

/// How a device was opened: enough to open it again after it was lost.
#[derive(Clone, Debug)]
pub(crate) struct Opening {
    pub(crate) instance: Instance,
    pub(crate) candidate: Candidate,
    pub(crate) backend: Backend,
    pub(crate) cache_folder: Option<PathBuf>,
}

/// A device with its programs, tables and launch sizes.
#[derive(Debug)]
pub(crate) struct DeviceContext {
    pub(crate) gpu: Gpu,
    /// Albedo tables of the BSDF, the same as the CPU's (`pumice_transport::bsdf::tables`).
    pub(crate) tables: Buffer,
    /// Launch sizes of the entry that adds samples.
    pub(crate) slices: Slices,
    /// Launch sizes of the entry that finds first surfaces.
    pub(crate) slices_of_firsts: Slices,
    /// What launches run.
    pub(crate) programs: Programs,
    /// The denoiser, once a picture was denoised.
    denoiser: Option<DenoiseProgram>,
    /// What resolves films, once one was.
    resolving: Option<ResolveProgram>,
}

impl DeviceContext {
    pub(crate) fn open(how: &Opening) -> Result<Self, DeviceError> {
        let gpu = Gpu::open(&how.instance, &how.candidate, how.backend, how.cache_folder.as_deref())?;
        let tables = bytemuck::cast_slice(&pumice_transport::bsdf::tables::TABLES);
        let tables = gpu.buffer_of("the tables of scattering", tables)?;
        Ok(Self {
            gpu,
            tables,
            slices: Slices::default(),
            slices_of_firsts: Slices::of_records(),
            programs: Programs::default(),
            denoiser: None,
            resolving: None,
        })
    }

    /// The denoiser; compiles it on first use.
    pub(crate) fn denoiser(&mut self) -> Result<&mut DenoiseProgram, DeviceError> {
        made_once(&self.gpu, &mut self.denoiser, DenoiseProgram::new)
    }

    /// What resolves films; compiles it on first use.
    pub(crate) fn resolving(&mut self) -> Result<&mut ResolveProgram, DeviceError> {
        made_once(&self.gpu, &mut self.resolving, ResolveProgram::new)
    }

    /// After memory was short: frees what can be made again, and makes launches smaller.
    pub(crate) fn shrink(&mut self) {
        self.programs.ready_mut().for_each(Program::drop_scratch);
        self.slices.shrink();
        self.slices_of_firsts.shrink();
        self.denoiser.iter_mut().for_each(DenoiseProgram::shrink);
        self.resolving.iter_mut().for_each(ResolveProgram::shrink);
    }

    /// Bytes of scratch memory that programs hold on the device.
    pub(crate) fn scratch_bytes(&self) -> u64 {
        self.programs.ready().map(Program::scratch_bytes).sum()
    }
}

/// A program that is compiled on first use.
fn made_once<'a, T>(
    gpu: &Gpu,
    place: &'a mut Option<T>,
    compile: impl FnOnce(&Gpu) -> Result<T, DeviceError>,
) -> Result<&'a mut T, DeviceError> {
    let made = match place.take() {
        Some(made) => made,
        None => {
            let made = gpu.compiling(|| compile(gpu))?;
            gpu.save_pipelines();
            made
        }
    };
    Ok(place.insert(made))
}
