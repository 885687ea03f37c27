//! A device and what is made for it once: programs, tables that no scene changes, and how large its launches are.

use std::path::PathBuf;

use crate::device::{Backend, Buffer, Candidate, DeviceError, Gpu, Instance};
use crate::program::Program;
use crate::shaders::{Entry, program};
use crate::slices::Slices;

/// What a device was opened by: enough to open it again after it was lost.
#[derive(Clone, Debug)]
pub(crate) struct Opening {
    pub(crate) instance: Instance,
    pub(crate) candidate: Candidate,
    pub(crate) backend: Backend,
    pub(crate) cache_folder: Option<PathBuf>,
}

/// See the module.
#[derive(Debug)]
pub(crate) struct DeviceContext {
    pub(crate) gpu: Gpu,
    /// How much light surfaces keep: the CPU's tables.
    pub(crate) tables: Buffer,
    /// Of samples.
    pub(crate) slices: Slices,
    /// Of first surfaces.
    pub(crate) slices_of_firsts: Slices,
    /// By entry and specialisation constants: no more than the kinds of scenes that were shown.
    programs: Vec<(Entry, Vec<u32>, Program)>,
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
            programs: Vec::new(),
        })
    }

    /// The program of an entry, compiled when it is first asked for.
    pub(crate) fn program(&mut self, entry: Entry, constants: &[u32]) -> Result<&mut Program, DeviceError> {
        let known = self.programs.iter().position(|(e, c, _)| *e == entry && c == constants);
        let place = match known {
            Some(place) => place,
            None => {
                self.programs.push((entry, constants.to_vec(), program(&self.gpu, entry, constants)?));
                self.gpu.save_pipelines();
                self.programs.len() - 1
            }
        };
        Ok(&mut self.programs[place].2)
    }

    /// Gives back what can be made again, and makes launches smaller, after memory was short.
    pub(crate) fn shrink(&mut self) {
        self.programs.iter_mut().for_each(|(_, _, p)| p.drop_scratch());
        self.slices.shrink();
        self.slices_of_firsts.shrink();
    }

    /// Bytes of memory that programs hold.
    pub(crate) fn scratch_bytes(&self) -> u64 {
        self.programs.iter().map(|(_, _, p)| p.scratch_bytes()).sum()
    }
}
