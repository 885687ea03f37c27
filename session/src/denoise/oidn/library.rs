//! The C interface of Open Image Denoise 2, of a library that is opened when the program runs.
//!
//! ```text
//! oidnNewDevice(CPU) ─► oidnCommitDevice ─► oidnNewFilter("RT") ─► images, hdr ─► oidnCommitFilter ─► oidnExecuteFilter
//!        └─ numThreads, setAffinity = false                              oidnGetDeviceError after each step that may fail ─┘
//! ```
//! A device lives for one call. No pointer leaves this module.

#![allow(unsafe_code, reason = "a library that is opened at run time is a list of C functions")]

use std::error::Error as _;
use std::ffi::{CStr, OsStr, c_char, c_int, c_void};
use std::ptr::{self, NonNull};

/// `OIDN_DEVICE_TYPE_CPU`.
const CPU: c_int = 1;
/// `OIDN_FORMAT_FLOAT3`.
const FLOAT3: c_int = 3;
/// Bytes of a pixel.
const STRIDE: usize = size_of::<[f32; 3]>();

type NewDevice = unsafe extern "C" fn(c_int) -> *mut c_void;
type NewFilter = unsafe extern "C" fn(*mut c_void, *const c_char) -> *mut c_void;
/// Commits, executes or releases a device or a filter.
type Act = unsafe extern "C" fn(*mut c_void);
type SetInt = unsafe extern "C" fn(*mut c_void, *const c_char, c_int);
type SetBool = unsafe extern "C" fn(*mut c_void, *const c_char, bool);
type GetInt = unsafe extern "C" fn(*mut c_void, *const c_char) -> c_int;
type GetError = unsafe extern "C" fn(*mut c_void, *mut *const c_char) -> c_int;
/// Filter, name, data, format, width, height, offset in bytes, bytes of a pixel, bytes of a row.
type SetImage =
    unsafe extern "C" fn(*mut c_void, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize);

/// An open library with the functions that are called.
#[derive(Debug)]
pub(super) struct Library {
    new_device: NewDevice,
    set_device_int: SetInt,
    set_device_bool: SetBool,
    get_device_int: GetInt,
    get_device_error: GetError,
    commit_device: Act,
    release_device: Act,
    new_filter: NewFilter,
    set_image: SetImage,
    set_filter_bool: SetBool,
    commit_filter: Act,
    execute_filter: Act,
    release_filter: Act,
    /// Keeps the functions in memory.
    _file: libloading::Library,
}

/// Pictures of one size, by rows. Colours are scene-linear, base colours from 0 to 1, normals from −1 to 1.
pub(super) struct Inputs<'a> {
    pub(super) size: [usize; 2],
    pub(super) color: &'a [[f32; 3]],
    pub(super) albedo: &'a [[f32; 3]],
    pub(super) normal: &'a [[f32; 3]],
}

impl Library {
    /// Opens the library of this path, or of this name where the system's loader finds it.
    ///
    /// # Errors
    /// The loader's words, or the first function that is missing.
    pub(super) fn open(name: &OsStr) -> Result<Self, String> {
        // SAFETY: the caller names a library of Open Image Denoise, or the system's loader finds one by that name; its initialisers are made to run
        // in any process. Whoever chooses the path decides which code runs, as with any program that the caller starts.
        let file = unsafe { libloading::Library::new(name) }.map_err(|e| {
            let said = e.to_string();
            let said = e.source().map_or(said.clone(), |source| format!("{said}: {source}"));
            // Linux' loader begins with the path, which the caller knows.
            said.strip_prefix(&format!("{}: ", name.display())).map(str::to_owned).unwrap_or(said)
        })?;
        macro_rules! function {
            ($name:literal) => {
                // SAFETY: `oidn.h` of version 2 declares the function of this name with the type of the field that it is put into.
                *unsafe { file.get(concat!($name, "\0").as_bytes()) }
                    .map_err(|_| concat!("expected version 2, which has the function ", $name, ", got a library without it"))?
            };
        }
        Ok(Self {
            new_device: function!("oidnNewDevice"),
            set_device_int: function!("oidnSetDeviceInt"),
            set_device_bool: function!("oidnSetDeviceBool"),
            get_device_int: function!("oidnGetDeviceInt"),
            get_device_error: function!("oidnGetDeviceError"),
            commit_device: function!("oidnCommitDevice"),
            release_device: function!("oidnReleaseDevice"),
            new_filter: function!("oidnNewFilter"),
            set_image: function!("oidnSetSharedFilterImage"),
            set_filter_bool: function!("oidnSetFilterBool"),
            commit_filter: function!("oidnCommitFilter"),
            execute_filter: function!("oidnExecuteFilter"),
            release_filter: function!("oidnReleaseFilter"),
            _file: file,
        })
    }

    /// Version of the library: major, minor, patch. It makes a device, as denoising does.
    ///
    /// # Errors
    /// What the library says where there is no device on this processor.
    pub(super) fn version(&self) -> Result<[u32; 3], String> {
        let device = Device::new(self)?;
        device.commit(1)?;
        Ok([c"versionMajor", c"versionMinor", c"versionPatch"].map(|part| device.int(part)))
    }

    /// Denoises a picture into `output`.
    ///
    /// # Errors
    /// Pictures of other sizes, and what the library says.
    pub(super) fn denoise(
        &self,
        inputs: &Inputs<'_>,
        output: &mut [[f32; 3]],
        threads: usize,
    ) -> Result<(), String> {
        let &Inputs { size: [width, height], color, albedo, normal } = inputs;
        let pixels = width.checked_mul(height).filter(|&n| n > 0);
        if [color.len(), albedo.len(), normal.len(), output.len()].iter().any(|&n| Some(n) != pixels) {
            return Err(format!("expected passes of {width} × {height} pixels, got others"));
        }
        let device = Device::new(self)?;
        device.commit(threads)?;

        let filter = Filter::new(&device)?;
        for (name, image) in [(c"color", color), (c"albedo", albedo), (c"normal", normal)] {
            filter.image(name, image.as_ptr().cast_mut().cast(), inputs.size);
        }
        filter.image(c"output", output.as_mut_ptr().cast(), inputs.size);
        filter.bool(c"hdr", true);

        // SAFETY: the filter is alive. Its images lie in slices of `width · height` pixels, checked above, which are borrowed until this function
        // ends: `output` alone, the others shared. The library only reads the images that are no output.
        unsafe { (self.commit_filter)(filter.handle.as_ptr()) };
        device.check()?;
        // SAFETY: as above; the call returns when all its threads are done with the images.
        unsafe { (self.execute_filter)(filter.handle.as_ptr()) };
        device.check()
    }
}

/// A device on the processor, released when it is dropped.
struct Device<'a> {
    library: &'a Library,
    handle: NonNull<c_void>,
}

impl<'a> Device<'a> {
    fn new(library: &'a Library) -> Result<Self, String> {
        // SAFETY: takes a number.
        match NonNull::new(unsafe { (library.new_device)(CPU) }) {
            Some(handle) => Ok(Self { library, handle }),
            None => Err(error(library, ptr::null_mut())
                .unwrap_or_else(|| "it gave no device on this processor".into())),
        }
    }

    /// Starts the device with so many threads, none of them tied to a core: others may be at work there.
    fn commit(&self, threads: usize) -> Result<(), String> {
        let (library, device) = (self.library, self.handle.as_ptr());
        let threads = c_int::try_from(threads).unwrap_or(c_int::MAX);
        // SAFETY: the device is alive, and the names are texts with a terminator that live for ever.
        unsafe {
            (library.set_device_int)(device, c"numThreads".as_ptr(), threads);
            (library.set_device_bool)(device, c"setAffinity".as_ptr(), false);
            (library.commit_device)(device);
        }
        self.check()
    }

    fn int(&self, name: &CStr) -> u32 {
        // SAFETY: the device is alive, and the name has a terminator.
        let value = unsafe { (self.library.get_device_int)(self.handle.as_ptr(), name.as_ptr()) };
        u32::try_from(value).unwrap_or(0)
    }

    /// The error since the last check.
    fn check(&self) -> Result<(), String> {
        error(self.library, self.handle.as_ptr()).map_or(Ok(()), Err)
    }
}

impl Drop for Device<'_> {
    fn drop(&mut self) {
        // SAFETY: the device is alive, and nobody uses it after this.
        unsafe { (self.library.release_device)(self.handle.as_ptr()) }
    }
}

/// The error of a device, or without one that of this thread, if there is any; asking forgets it.
fn error(library: &Library, device: *mut c_void) -> Option<String> {
    let mut message = ptr::null();
    // SAFETY: the device is alive or null, which stands for errors of this thread; `message` is ours.
    let code = unsafe { (library.get_device_error)(device, &raw mut message) };
    if code == 0 {
        return None;
    }
    if message.is_null() {
        return Some(format!("error {code}"));
    }
    // SAFETY: the message ends with a terminator, and lives until this thread asks again.
    Some(unsafe { CStr::from_ptr(message) }.to_string_lossy().into_owned())
}

/// A filter of the kind for ray tracing, released when it is dropped, before its device.
struct Filter<'a> {
    device: &'a Device<'a>,
    handle: NonNull<c_void>,
}

impl<'a> Filter<'a> {
    fn new(device: &'a Device<'a>) -> Result<Self, String> {
        // SAFETY: the device is alive and committed, and the name has a terminator.
        let handle = unsafe { (device.library.new_filter)(device.handle.as_ptr(), c"RT".as_ptr()) };
        match NonNull::new(handle) {
            Some(handle) => Ok(Self { device, handle }),
            None => {
                Err(error(device.library, device.handle.as_ptr())
                    .unwrap_or_else(|| "it gave no filter".into()))
            }
        }
    }

    /// Names an image of packed pixels. The filter uses it only while it is committed and executed.
    fn image(&self, name: &CStr, pixels: *mut c_void, [width, height]: [usize; 2]) {
        let filter = self.handle.as_ptr();
        // SAFETY: the filter is alive and the name has a terminator; this call keeps the pointer and reads nothing.
        unsafe {
            (self.device.library.set_image)(
                filter,
                name.as_ptr(),
                pixels,
                FLOAT3,
                width,
                height,
                0,
                STRIDE,
                STRIDE * width,
            );
        }
    }

    fn bool(&self, name: &CStr, value: bool) {
        // SAFETY: the filter is alive, and the name has a terminator.
        unsafe { (self.device.library.set_filter_bool)(self.handle.as_ptr(), name.as_ptr(), value) }
    }
}

impl Drop for Filter<'_> {
    fn drop(&mut self) {
        // SAFETY: the filter is alive, its device too, and nobody uses it after this.
        unsafe { (self.device.library.release_filter)(self.handle.as_ptr()) }
    }
}
