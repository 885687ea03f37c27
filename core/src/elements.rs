//! Elements of an array, either on the heap or in a file that is mapped into memory.
//!
//! A mapped array takes no memory of its own: its pages belong to the system's file cache, which other processes share and which the system
//! reclaims when memory runs short.

use std::fmt;
use std::fs::File;
use std::ops::{Deref, Range};
use std::ptr::NonNull;
use std::sync::Arc;

use bytemuck::Pod;
use memmap2::Mmap;
#[cfg(unix)]
use memmap2::UncheckedAdvice;

/// A file mapped into memory, with the length that it had when it was mapped.
#[derive(Clone)]
pub(crate) struct MappedFile(Arc<Mmap>);

impl MappedFile {
    /// Maps a whole file for reading.
    pub(crate) fn new(file: &File) -> std::io::Result<Self> {
        // SAFETY: the mapping is read only and outlives every borrow of it (`Arc`). Another program may still change the file in place,
        // which cannot be ruled out. Then elements change too; no code here relies on unchanged elements beyond what bounds checks catch. A
        // file that is truncated ends the process with a signal. Pumice itself replaces files by renaming, which leaves the mapped one
        // whole; `docs/file-format.md` warns of programs that do not, and callers choose to map.
        #[allow(unsafe_code)]
        let map = unsafe { Mmap::map(file)? };
        Ok(Self(Arc::new(map)))
    }

    /// All bytes of the file.
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.0
    }

    /// Releases the pages that were touched; the system reads them from the file again when they are needed. Systems without such advice
    /// keep the pages.
    pub(crate) fn let_go(&self) {
        #[cfg(unix)]
        {
            // SAFETY: the mapping is of a file and read only, so no page holds data that is not in the file.
            #[allow(unsafe_code)]
            let done = unsafe { self.0.unchecked_advise(UncheckedAdvice::DontNeed) };
            // A system may ignore this advice, which leaves the pages where they are.
            let _ = done;
        }
    }

    /// The elements stored in these bytes; `None` where they cannot be used in place, because their offset or length does not fit
    /// the elements' alignment and size, or the machine is not little-endian.
    pub(crate) fn elements<T: Pod>(&self, range: Range<usize>) -> Option<Elements<T>> {
        if cfg!(target_endian = "big") {
            return None;
        }
        let elements: &[T] = bytemuck::try_cast_slice(self.0.get(range)?).ok()?;
        Some(Elements { at: NonNull::from(elements), kept_by: Keeper::Mapped(self.clone()) })
    }
}

/// An array that owns its elements on the heap or borrows them from a mapped file.
pub struct Elements<T> {
    /// Address of the elements; asking `kept_by` for it on each access costs a tenth of the time of a ray.
    at: NonNull<[T]>,
    kept_by: Keeper<T>,
}

enum Keeper<T> {
    Heap(Vec<T>),
    Mapped(#[expect(dead_code, reason = "it keeps the file mapped")] MappedFile),
}

// SAFETY: `Elements` gives out only shared references to its elements, like a `Vec` that is never changed; both kinds of keeper may be sent
// and shared between threads where the elements may.
#[allow(unsafe_code)]
unsafe impl<T: Send> Send for Elements<T> {}
// SAFETY: the argument for `Send` above covers `Sync` too.
#[allow(unsafe_code)]
unsafe impl<T: Sync> Sync for Elements<T> {}

impl<T> Elements<T> {
    /// Bytes on the heap; 0 for a mapped array.
    pub(crate) fn heap_bytes(&self) -> u64 {
        match &self.kept_by {
            Keeper::Heap(v) => (v.capacity() * size_of::<T>()) as u64,
            Keeper::Mapped(_) => 0,
        }
    }

    /// Bytes of a mapped file; 0 for an array on the heap.
    pub(crate) fn mapped_bytes(&self) -> u64 {
        match &self.kept_by {
            Keeper::Heap(_) => 0,
            Keeper::Mapped(_) => (self.at.len() * size_of::<T>()) as u64,
        }
    }
}

impl<T> Deref for Elements<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        // SAFETY: `at` points to a slice that `kept_by` keeps alive; neither moving this value nor any code here moves or changes that
        // slice.
        #[allow(unsafe_code)]
        unsafe {
            self.at.as_ref()
        }
    }
}

impl<T> From<Vec<T>> for Elements<T> {
    fn from(mut v: Vec<T>) -> Self {
        v.shrink_to_fit();
        Self { at: NonNull::from(v.as_slice()), kept_by: Keeper::Heap(v) }
    }
}

impl<T> Default for Elements<T> {
    fn default() -> Self {
        Vec::new().into()
    }
}

impl<T: fmt::Debug> fmt::Debug for Elements<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.deref().fmt(f)
    }
}

impl<T: PartialEq> PartialEq for Elements<T> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}
