//! NumPy's `.npz`: a ZIP archive of `.npy` arrays, stored (`numpy.savez`) or deflated (`numpy.savez_compressed`).
//!
//! The crate `zip` reads the archive's directory (including ZIP64). [`crate::gzip`] then streams the voxels from the member's offset in the
//! file; they are compared with the directory's CRC-32 (PKWARE, *APPNOTE* §4.4.7) when their last byte is read.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use pumice_core::error::one_line;
use zip::CompressionMethod;
use zip::read::ZipArchive;
use zip::result::ZipError;

use crate::choice::{ChoiceValue, OpenChoice};
use crate::error::{FormatError, Result};
use crate::gzip::{InflateStream, Wrapping};
use crate::header_text::shorten;
use crate::npy::Array;
use crate::npy_header::{self, NpyHeader};
use crate::options::{OpenOptions, Warnings};
use crate::stream::{ByteStream, PlainStream, open_file};
use crate::volume_file::{Format, Takes, VolumeFile, Voxels};

/// First bytes of an archive with members, and of one without.
const MAGICS: [&[u8]; 2] = [b"PK\x03\x04", b"PK\x05\x06"];

/// NPZ files.
pub(crate) const FORMAT: Format = Format {
    name: "NPZ",
    takes: Takes { axes: true, array: true, ..Takes::NOTHING },
    recognises: |_, head| MAGICS.iter().any(|magic| head.starts_with(magic)),
    read,
};

/// Reads the directory of `path` and the header of the chosen array.
fn read(path: &Path, options: &OpenOptions) -> Result<VolumeFile> {
    let members = members(path)?;
    let (member, header, open) = pick(path, &members, options)?;
    let mut array = Array::new(path, &header, options)?;
    array.choices.splice(0..0, open);
    let (expected, got) = (array.layout.total_bytes(), member.bytes.saturating_sub(header.bytes));
    if got < expected {
        return Err(FormatError::Short { path: path.to_owned(), expected, got, at: None });
    }
    let encoding = if member.deflated { "deflate" } else { "raw" };
    let (path, member, warnings) = (path.to_owned(), member.clone(), options.warnings.clone());
    // The archive's checksum is of the whole member.
    let voxels = Voxels::Stream(Box::new(move || {
        let mut stream = MemberStream::open(&path, &member, &warnings)?;
        stream.skip(header.bytes)?;
        Ok(Box::new(stream))
    }));
    Ok(array.volume_file("NPZ", encoding, voxels))
}

/// One `.npy` file of the archive.
#[derive(Clone, Debug)]
struct Member {
    /// Name without `.npy`, as NumPy uses it.
    name: String,
    start: u64,
    deflated: bool,
    /// Inflated size and checksum, from the directory.
    bytes: u64,
    crc: u32,
}

/// Lists the arrays in the archive's directory.
fn members(path: &Path) -> Result<Vec<Member>> {
    let explain = |error: ZipError| match error {
        ZipError::Io(source) if source.kind() != std::io::ErrorKind::UnexpectedEof => {
            FormatError::Io { path: path.to_owned(), source }
        }
        other => FormatError::damaged(
            path,
            format!(
                "the ZIP directory at the file's end is damaged or cut off: {}",
                one_line(&other.to_string())
            ),
        ),
    };
    let file: BufReader<File> = BufReader::new(open_file(path)?);
    let mut archive = ZipArchive::new(file).map_err(explain)?;
    let mut members = Vec::new();
    for index in 0..archive.len() {
        let file = archive.by_index_raw(index).map_err(explain)?;
        let name = String::from_utf8_lossy(file.name_raw()).into_owned();
        let Some(name) = name.strip_suffix(".npy") else { continue };
        let name = name.to_owned();
        let refuse = |what: String| {
            Err(FormatError::unsupported(path, what, "save the array again with numpy.savez_compressed"))
        };
        if file.encrypted() {
            return refuse(format!("the array {:?} is encrypted", shorten(&name)));
        }
        let deflated = match u16_of(file.compression()) {
            STORED => false,
            DEFLATED => true,
            other => {
                return refuse(format!("the array {:?} is compressed by ZIP method {other}", shorten(&name)));
            }
        };
        let Some(start) = file.data_start() else {
            return Err(FormatError::damaged(
                path,
                format!("the archive does not say where the array {:?} begins", shorten(&name)),
            ));
        };
        if !deflated && file.compressed_size() != file.size() {
            return Err(FormatError::damaged(
                path,
                format!(
                    "the array {:?} is stored in {} bytes but should have {}",
                    shorten(&name),
                    file.compressed_size(),
                    file.size()
                ),
            ));
        }
        members.push(Member { name, start, deflated, bytes: file.size(), crc: file.crc32() });
    }
    Ok(members)
}

/// ZIP method numbers (*APPNOTE* §4.4.5).
const STORED: u16 = 0;
const DEFLATED: u16 = 8;

/// The number of a method. Without its `deflate` feature, the crate treats method 8 as unsupported.
#[expect(deprecated, reason = "the only way to the number of a method that the crate itself does not decode")]
fn u16_of(method: CompressionMethod) -> u16 {
    method.to_u16()
}

/// Names of arrays in one line.
fn names<'a>(members: impl ExactSizeIterator<Item = &'a Member>) -> String {
    // These suffice to choose from; an archive may hold thousands.
    const MOST: usize = 32;
    let more = members.len() > MOST;
    let mut names: Vec<String> = members.take(MOST).map(|m| shorten(&one_line(&m.name))).collect();
    if more {
        names.push("…".into());
    }
    names.join(", ")
}

/// The array that the caller named, or the first that can be a volume; with the choice among several.
fn pick<'a>(
    path: &Path,
    members: &'a [Member],
    options: &OpenOptions,
) -> Result<(&'a Member, NpyHeader, Option<OpenChoice>)> {
    let header = |member: &Member| {
        let mut stream = MemberStream::open(path, member, &options.warnings)?;
        npy_header::read(path, &mut stream)
    };
    if let Some(wanted) = &options.array {
        let wanted = wanted.strip_suffix(".npy").unwrap_or(wanted);
        let Some(member) = members.iter().find(|m| m.name == wanted) else {
            return Err(FormatError::option(
                path,
                format!("the archive has no array {wanted:?}; it has: {}", names(members.iter())),
            ));
        };
        return Ok((member, header(member)?, None));
    }
    if members.is_empty() {
        return Err(FormatError::unsupported(
            path,
            "this ZIP archive holds no .npy array",
            "unpack it and open the volume inside",
        ));
    }
    // Scalars, lists and text beside the labels (spacing, names) are skipped.
    let mut candidates = Vec::new();
    for member in members {
        let header = header(member)?;
        let sizes = header.shape.iter().filter(|&&size| size > 1).count();
        if sizes >= 2 && Array::new(path, &header, &OpenOptions::default()).is_ok() {
            candidates.push((member, header));
        }
    }
    if candidates.is_empty() && members.len() == 1 {
        return Ok((&members[0], header(&members[0])?, None));
    }
    let open = (candidates.len() > 1).then(|| open_array(&candidates));
    match candidates.into_iter().next() {
        Some((member, header)) => Ok((member, header, open)),
        None => Err(FormatError::unsupported(
            path,
            format!("none of the arrays {} is a label volume", names(members.iter())),
            "labels are arrays of two or three axes of whole numbers",
        )),
    }
}

/// The choice among arrays of which each can be a volume.
fn open_array(candidates: &[(&Member, NpyHeader)]) -> OpenChoice {
    let value = |(member, header): &(&Member, NpyHeader)| ChoiceValue {
        value: member.name.clone(),
        text: format!("{} of {}", header.shape_text(), header.descr),
    };
    OpenChoice {
        keyword: "array",
        option: "--array",
        what: format!("the archive has {} arrays that may be the labels", candidates.len()),
        listed: names(candidates.iter().map(|(member, _)| *member)),
        values: candidates.iter().map(value).collect(),
        count: candidates.len() as u64,
        assumed: None,
    }
}

/// The bytes of one member; their CRC-32 is checked at the end.
struct MemberStream {
    path: PathBuf,
    inner: Box<dyn ByteStream>,
    name: String,
    left: u64,
    hasher: crc32fast::Hasher,
    crc: u32,
    checked: bool,
}

impl MemberStream {
    fn open(path: &Path, member: &Member, warnings: &Warnings) -> Result<Self> {
        let inner: Box<dyn ByteStream> = if member.deflated {
            Box::new(InflateStream::open(path, member.start, Wrapping::Deflate, warnings)?)
        } else {
            Box::new(PlainStream::open(path, member.start)?)
        };
        Ok(Self {
            path: path.to_owned(),
            inner,
            name: member.name.clone(),
            left: member.bytes,
            hasher: crc32fast::Hasher::new(),
            crc: member.crc,
            checked: false,
        })
    }

    /// Compares the checksum, once.
    fn check(&mut self) -> Result<()> {
        let got = self.hasher.clone().finalize();
        if !self.checked && got != self.crc {
            return Err(FormatError::damaged(
                &self.path,
                format!(
                    "the array {:?} has CRC-32 {got:08x}, expected {:08x}: the file is damaged",
                    shorten(&self.name),
                    self.crc
                ),
            ));
        }
        self.checked = true;
        Ok(())
    }
}

impl ByteStream for MemberStream {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        if buffer.is_empty() {
            return Ok(0);
        }
        let piece = buffer.len().min(usize::try_from(self.left).unwrap_or(usize::MAX));
        let n = if piece == 0 { 0 } else { self.inner.read(&mut buffer[..piece])? };
        self.hasher.update(&buffer[..n]);
        self.left -= n as u64;
        if n == 0 && self.left > 0 {
            return Err(FormatError::damaged(
                &self.path,
                format!("the array {:?} ends {} bytes early", shorten(&self.name), self.left),
            ));
        }
        if self.left == 0 {
            self.check()?;
        }
        Ok(n)
    }

    fn position(&self) -> Option<u64> {
        self.inner.position()
    }
}
