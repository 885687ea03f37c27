//! Elements of an array: on the heap, or where they lie in a file that is mapped into memory.
//!
//! A mapped array takes no memory of its own: its pages are the system's file cache, which other processes share and which is given
//! back where memory runs short.

use std::fmt;
use std::fs::File;
use std::ops::{Deref, Range};
use std::ptr::NonNull;
use std::sync::Arc;

use bytemuck::Pod;
use memmap2::Mmap;
#[cfg(unix)]
use memmap2::UncheckedAdvice;

/// A file in memory, as long as it was when it was mapped.
#[derive(Clone)]
pub(crate) struct MappedFile(Arc<Mmap>);

impl MappedFile {
    /// Maps all of a file, to be read.
    pub(crate) fn new(file: &File) -> std::io::Result<Self> {
        // SAFETY: the mapping is read only and outlives every borrow of it (`Arc`). What cannot be ruled out is that another
        // program changes the file in place: then elements change too, which no code here relies on not to happen beyond what
        // bounds checks catch, and a file cut short ends the process with a signal. Pumice itself replaces files by renaming, which
        // leaves the mapped one whole; `docs/file-format.md` warns of programs that do not, and callers choose to map.
        #[allow(unsafe_code)]
        let map = unsafe { Mmap::map(file)? };
        Ok(Self(Arc::new(map)))
    }

    /// All of its bytes.
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.0
    }

    /// Lets go of the pages that were touched: they are read from the file again when they are needed. Where the system has no such
    /// thing, they stay.
    pub(crate) fn let_go(&self) {
        #[cfg(unix)]
        {
            // SAFETY: the mapping is of a file and read only, so no page holds anything that the file does not.
            #[allow(unsafe_code)]
            let done = unsafe { self.0.unchecked_advise(UncheckedAdvice::DontNeed) };
            // It is advice: what the system does not take leaves the pages where they are.
            let _ = done;
        }
    }

    /// The elements in these bytes; `None` where they do not lie as elements do in memory: on a place that is no multiple of their
    /// size, or on a machine that is not little-endian.
    pub(crate) fn elements<T: Pod>(&self, range: Range<usize>) -> Option<Elements<T>> {
        if cfg!(target_endian = "big") {
            return None;
        }
        let elements: &[T] = bytemuck::try_cast_slice(self.0.get(range)?).ok()?;
        Some(Elements { at: NonNull::from(elements), kept_by: Keeper::Mapped(self.clone()) })
    }
}

/// See the module.
pub struct Elements<T> {
    /// Where they are: asking the keeper each time costs a tenth of a ray.
    at: NonNull<[T]>,
    kept_by: Keeper<T>,
}

enum Keeper<T> {
    Heap(Vec<T>),
    Mapped(#[expect(dead_code, reason = "it keeps the file mapped")] MappedFile),
}

// SAFETY: nothing but shared references to elements is ever given out, as by a `Vec` that is not changed; keepers of both kinds may be
// sent and shared where elements may.
#[allow(unsafe_code)]
unsafe impl<T: Send> Send for Elements<T> {}
// SAFETY: as above.
#[allow(unsafe_code)]
unsafe impl<T: Sync> Sync for Elements<T> {}

impl<T> Elements<T> {
    /// Bytes of the heap that it holds; none where it is mapped.
    pub(crate) fn heap_bytes(&self) -> u64 {
        match &self.kept_by {
            Keeper::Heap(v) => (v.capacity() * size_of::<T>()) as u64,
            Keeper::Mapped(_) => 0,
        }
    }

    /// Bytes of a file that it maps.
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
        // SAFETY: `at` was a slice of what `kept_by` keeps, which neither a move of this value nor anything else here moves or changes.
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
