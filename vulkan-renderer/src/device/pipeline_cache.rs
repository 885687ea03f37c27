//! Keeps the driver's compiled pipelines on disk, so that the next start need not compile them again.
//!
//! ```text
//! offset 0          8                    16                  24
//!        ┌──────────┬────────────────────┬───────────────────┬──────────────────────────────┐
//!        │"PUMVKPC1"│ length of the blob │ XXH3-64 of the    │ blob as the driver made it   │
//!        │          │ u64                │ blob, u64         │                              │
//!        └──────────┴────────────────────┴───────────────────┴──────────────────────────────┘
//! ```
//! The file's name holds vendor, device, driver version and the driver's own cache identifier, so each device and driver has a file of its
//! own. Drivers do not check the data (some crash on a damaged blob), hence the checksum: a file whose checksum is wrong is ignored and
//! replaced. The file is written under a temporary name and renamed, so it is either complete or absent.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use ash::vk;
use xxhash_rust::xxh3::xxh3_64;

use super::DeviceError;

const MAGIC: &[u8; 8] = b"PUMVKPC1";
const HEADER_BYTES: usize = 24;
/// Longest accepted file. Blobs of a dozen pipelines have a few megabytes, so a longer file is not one of Pumice's.
const MOST_BYTES: u64 = 256 << 20;

pub(super) struct PipelineCache {
    pub(super) handle: vk::PipelineCache,
    pub(super) file: Option<PathBuf>,
}

impl PipelineCache {
    pub(super) fn none() -> Self {
        Self { handle: vk::PipelineCache::null(), file: None }
    }

    /// Creates a cache for the device, from the file on disk where that is valid.
    pub(super) fn open(
        calls: &ash::Device,
        properties: &vk::PhysicalDeviceProperties,
        folder: Option<&Path>,
    ) -> Result<Self, DeviceError> {
        let file = folder.map(|f| f.join(file_name(properties)));
        let blob = file.as_deref().and_then(read).filter(|blob| is_of(blob, properties)).unwrap_or_default();
        let create = vk::PipelineCacheCreateInfo::default().initial_data(&blob);
        // SAFETY: the blob is one that a driver of this very name gave out, unchanged.
        let handle = unsafe { calls.create_pipeline_cache(&create, None) }
            .map_err(DeviceError::of("vkCreatePipelineCache"))?;
        Ok(Self { handle, file })
    }

    /// Writes it to disk. If the folder cannot be written, the next start takes longer; nothing else is lost.
    pub(super) fn save(&self, calls: &ash::Device) {
        let Some(file) = &self.file else { return };
        // SAFETY: the handle is of this device.
        if let Ok(blob) = unsafe { calls.get_pipeline_cache_data(self.handle) } {
            let _ = write(file, &blob);
        }
    }

    /// # Safety
    /// * The cache is of this device, and is not used afterwards.
    pub(super) unsafe fn destroy(&self, calls: &ash::Device) {
        // SAFETY: as the caller promises.
        unsafe { calls.destroy_pipeline_cache(self.handle, None) };
    }
}

/// Name of the device's file.
pub(super) fn file_name(p: &vk::PhysicalDeviceProperties) -> String {
    let uuid: String = p.pipeline_cache_uuid.iter().map(|b| format!("{b:02x}")).collect();
    format!("{:08x}-{:08x}-{:08x}-{uuid}.pipelines", p.vendor_id, p.device_id, p.driver_version)
}

/// Whether Vulkan's own header of the blob (length, version 1, vendor, device, identifier) matches the device.
fn is_of(blob: &[u8], p: &vk::PhysicalDeviceProperties) -> bool {
    let word = |at: usize| blob.get(at..at + 4).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    word(0).is_some_and(|length| length >= 32)
        && word(4) == Some(1)
        && word(8) == Some(p.vendor_id)
        && word(12) == Some(p.device_id)
        && blob.get(16..32) == Some(&p.pipeline_cache_uuid[..])
}

fn read(file: &Path) -> Option<Vec<u8>> {
    if std::fs::metadata(file).ok()?.len() > MOST_BYTES {
        return None;
    }
    let bytes = std::fs::read(file).ok()?;
    let (header, blob) = bytes.split_at_checked(HEADER_BYTES)?;
    let number = |at: usize| header.get(at..at + 8).and_then(|b| b.try_into().ok()).map(u64::from_le_bytes);
    let valid = header.starts_with(MAGIC)
        && number(8) == Some(blob.len() as u64)
        && number(16) == Some(xxh3_64(blob));
    valid.then(|| blob.to_vec())
}

fn write(file: &Path, blob: &[u8]) -> std::io::Result<()> {
    if let Some(folder) = file.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let mut bytes = Vec::with_capacity(HEADER_BYTES + blob.len());
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&(blob.len() as u64).to_le_bytes());
    bytes.extend_from_slice(&xxh3_64(blob).to_le_bytes());
    bytes.extend_from_slice(blob);
    // Several devices of one process may write at the same time, as may several processes.
    static WRITES: AtomicU64 = AtomicU64::new(0);
    let number = WRITES.fetch_add(1, Ordering::Relaxed);
    let temporary = file.with_extension(format!("{}-{number}.tmp", std::process::id()));
    let written = std::fs::write(&temporary, bytes).and_then(|()| std::fs::rename(&temporary, file));
    if written.is_err() {
        let _ = std::fs::remove_file(&temporary);
    }
    written
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_damaged_is_ignored() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a/b.pipelines");
        assert_eq!(read(&file), None);
        let blob: Vec<u8> = (0..200).collect();
        write(&file, &blob).unwrap();
        assert_eq!(read(&file).as_deref(), Some(&blob[..]));
        assert_eq!(std::fs::read_dir(file.parent().unwrap()).unwrap().count(), 1, "a temporary file is left");
        let whole = std::fs::read(&file).unwrap();
        for at in [0, 8, 16, 24, whole.len() - 1] {
            let mut bad = whole.clone();
            bad[at] ^= 1;
            std::fs::write(&file, bad).unwrap();
            assert_eq!(read(&file), None, "byte {at}");
        }
        for length in [0, 7, 23, 24, whole.len() - 1] {
            std::fs::write(&file, &whole[..length]).unwrap();
            assert_eq!(read(&file), None, "{length} bytes");
        }
    }

    /// While several writers are active, a reader always finds a complete blob, and no temporary files are left.
    #[test]
    fn writers_at_once_leave_one_whole_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("b.pipelines");
        let blob = |w: u8| vec![w; 60_000 + usize::from(w)];
        write(&file, &blob(0)).unwrap();
        std::thread::scope(|s| {
            for w in 1..5u8 {
                let file = &file;
                s.spawn(move || (0..20).for_each(|_| write(file, &blob(w)).unwrap()));
            }
            for _ in 0..100 {
                let found = read(&file).expect("a whole file at any time");
                assert_eq!(found, blob(found[0]));
            }
        });
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "a temporary file is left");
    }

    #[test]
    fn another_devices_cache_is_ignored() {
        let mut p = vk::PhysicalDeviceProperties { vendor_id: 7, device_id: 9, ..Default::default() };
        p.pipeline_cache_uuid = [3; 16];
        let blob: Vec<u8> =
            [32u32, 1, 7, 9].iter().flat_map(|w| w.to_le_bytes()).chain([3; 16]).chain([1, 2, 3]).collect();
        assert!(is_of(&blob, &p));
        assert!(!is_of(&blob[..31], &p));
        for other in [
            vk::PhysicalDeviceProperties { vendor_id: 8, ..p },
            vk::PhysicalDeviceProperties { device_id: 8, ..p },
            vk::PhysicalDeviceProperties { pipeline_cache_uuid: [4; 16], ..p },
        ] {
            assert!(!is_of(&blob, &other));
            assert!(other.pipeline_cache_uuid == p.pipeline_cache_uuid || file_name(&other) != file_name(&p));
        }
    }
}
