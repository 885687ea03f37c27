//! Reads OpenEXR files, of Pumice and of other programs; damaged ones are refused.
//!
//! ```text
//! read the headers → choose the part and the layer → check sizes against limits and the file's length → reserve
//! read chunks in batches → decompress in parallel → copy the wanted channels' lines to their places
//! check that every pixel of the data window came, once
//! ```

use std::collections::{BTreeMap, HashSet};
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use exr::block::UncompressedBlock;
use exr::block::chunk::Chunk;
use exr::block::reader::ChunksReader;
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, SampleType, Text};
use exr::meta::header::Header;
use exr::prelude::{Vec2, f16};
use pumice_core::reserve::reserved;
use pumice_core::{NoMemory, open_input};
use rayon::prelude::*;

use crate::cryptomatte::{self, Matte};
use crate::exr_file::{INSTANCE_CHANNEL, NOISY_LAYER, channels_of_pass, check_size};
use crate::picture_labels::{LABELS_KEY, labels_of};
use crate::provenance_paths::from_file;
use crate::provenance_text::PROVENANCE_KEY;
use crate::{Image, InstanceLabels, Pass, Picture, PictureError, Provenance};

/// Largest compression ratio that is believed. Deflate, the strongest of EXR's codecs, reaches 1032; twice that leaves room for the
/// others. A file that claims more is damaged, and is refused before memory is reserved for it.
const MAX_EXPANSION: u64 = 2048;
/// What every OpenEXR file begins with (*OpenEXR File Layout*, magic number).
const MAGIC: [u8; 4] = [0x76, 0x2F, 0x31, 0x01];

/// Number of chunks that are decompressed at once.
const BATCH_CHUNKS: usize = 64;

/// The destination of a channel's samples.
#[derive(Clone, Copy, PartialEq, Eq)]
enum ChannelTarget {
    Color(usize),
    /// The mean of the samples of a denoised picture.
    Noisy(usize),
    Alpha,
    /// A pass with three channels.
    Triple(Pass, usize),
    /// A pass with one channel.
    Number(Pass),
    Label,
    Instance,
    /// A layer of a matte, by its number.
    Matte(Pass, usize, usize),
}

/// Reads the picture at `path`.
pub(crate) fn read(path: &Path) -> Result<Picture, PictureError> {
    let io = |source| PictureError::Io { path: path.to_owned(), source };
    let file = open_input(path).map_err(io)?;
    let length_bytes = file.metadata().map_err(io)?.len();
    let mut reader = BufReader::new(file);
    if reader.fill_buf().map_err(io)?.starts_with(b"\x89PNG\r\n\x1A\n") {
        let what =
            "expected an OpenEXR picture, got a PNG, which has neither passes nor scene-linear colours";
        return Err(PictureError::File { path: path.to_owned(), what: what.into() });
    }
    let mut picture = read_from(reader, length_bytes).map_err(|failure| failure.at(path))?;
    picture.provenance = picture.provenance.map(|made| from_file(made, path));
    Ok(picture)
}

/// Reads only the provenance; `None` if the file has none.
pub(crate) fn read_provenance_from(bytes: impl Read + Seek) -> Result<Option<Provenance>, Failure> {
    for header in exr::block::read(bytes, false)?.headers() {
        let found = provenance_of(header).map_err(|e| format!("attribute {PROVENANCE_KEY}: {e}"))?;
        if found.is_some() {
            return Ok(found);
        }
    }
    Ok(None)
}

/// A fault in the file, without its path.
#[derive(Debug)]
pub(crate) enum Failure {
    Io(std::io::Error),
    File(String),
}

impl Failure {
    /// Adds the path to a fault, for the user.
    pub(crate) fn at(self, path: &Path) -> PictureError {
        match self {
            Self::Io(source) => PictureError::Io { path: path.to_owned(), source },
            Self::File(what) => PictureError::File { path: path.to_owned(), what },
        }
    }
}

impl From<String> for Failure {
    fn from(what: String) -> Self {
        Self::File(what)
    }
}

impl From<exr::error::Error> for Failure {
    fn from(error: exr::error::Error) -> Self {
        match error {
            exr::error::Error::Io(e) if e.kind() != std::io::ErrorKind::UnexpectedEof => Self::Io(e),
            exr::error::Error::Io(_) => Self::File("damaged OpenEXR file: it ends too early".into()),
            exr::error::Error::NotSupported(what) => {
                Self::File(format!("OpenEXR feature not supported: {what}"))
            }
            other => Self::File(format!("damaged OpenEXR file: {other}")),
        }
    }
}

fn read_from(mut bytes: impl Read + Seek, length_bytes: u64) -> Result<Picture, Failure> {
    let mut start = [0; MAGIC.len()];
    let is_exr = match bytes.read_exact(&mut start) {
        Ok(()) => start == MAGIC,
        Err(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => false,
        Err(e) => return Err(Failure::Io(e)),
    };
    if !is_exr {
        return Err(Failure::File("expected an OpenEXR file, got another kind of file".into()));
    }
    bytes.seek(SeekFrom::Start(0)).map_err(Failure::Io)?;
    let reader = exr::block::read(bytes, false)?;
    let (layer, prefix) = choose(reader.headers())?;
    let header = reader.headers()[layer].clone();
    let places = places_of(&header, &prefix)?;
    let display = header.shared_attributes.display_window;
    let (width, height) = (display.size.0, display.size.1);
    check_size(width, height)?;
    check_size(header.layer_size.0, header.layer_size.1)?;
    let of_data = pixels_of(header.layer_size).saturating_mul(header.channels.bytes_per_pixel as u64);
    let of_picture = pixels_of(display.size).saturating_mul(12);
    let claimed = of_data.max(of_picture);
    if claimed > length_bytes.saturating_mul(MAX_EXPANSION) {
        return Err(Failure::File(format!(
            "damaged OpenEXR file: its {length_bytes} bytes cannot hold the {claimed} bytes of pixels it claims"
        )));
    }
    let provenance = provenance_of(&header).map_err(|e| format!("attribute {PROVENANCE_KEY}: {e}"))?;
    let labels = labels_of_header(&header).map_err(|e| format!("attribute {LABELS_KEY}: {e}"))?;
    let names = names_of_mattes(&header)?;
    let mut planes = Planes::new(width, height, &places)?;

    let data_in_display = [0, 1].map(|a| {
        let of = |v: Vec2<i32>| i64::from(if a == 0 { v.0 } else { v.1 });
        of(header.own_attributes.layer_position) - of(display.position)
    });
    let mut chunks = reader
        .filter_chunks(false, |_, tile, block| block.layer == layer && tile.level_index == Vec2(0, 0))?;
    let meta = chunks.meta_data().clone();
    let mut seen = HashSet::new();
    let mut pixels_left = pixels_of(header.layer_size);
    loop {
        let batch: Vec<_> = chunks.by_ref().take(BATCH_CHUNKS).collect::<Result<_, _>>()?;
        if batch.is_empty() {
            break;
        }
        let blocks: Vec<_> =
            batch.into_par_iter().map(|chunk| decompress(chunk, &meta)).collect::<Result<_, _>>()?;
        for block in &blocks {
            let index = block.index;
            let expected_bytes = index.pixel_size.area() * header.channels.bytes_per_pixel;
            if index.layer != layer
                || index.level != Vec2(0, 0)
                || block.data.len() != expected_bytes
                || !seen.insert((index.pixel_position.0, index.pixel_position.1))
            {
                return Err(Failure::File(
                    "damaged OpenEXR file: a chunk is not where the table says".into(),
                ));
            }
            pixels_left = pixels_left.saturating_sub(pixels_of(index.pixel_size));
            for line in block.lines(&header.channels) {
                if let Some(place) = places[line.location.channel] {
                    let kind = header.channels.list[line.location.channel].sample_type;
                    let at = line.location.position;
                    let to = [at.0 as i64 + data_in_display[0], at.1 as i64 + data_in_display[1]];
                    planes.put(place, kind, to, line.value);
                }
            }
        }
    }
    if pixels_left != 0 {
        return Err(Failure::File(format!("damaged OpenEXR file: {pixels_left} pixels are missing")));
    }
    let dpi = header.own_attributes.horizontal_density.map(f64::from);
    Ok(Picture { labels, dpi, ..planes.into_picture(provenance, names) })
}

/// Decompresses a chunk, damaged or not.
fn decompress(chunk: Chunk, meta: &MetaData) -> Result<UncompressedBlock, Failure> {
    // exr 1.74's decoder of B44 panics on a damaged chunk: it indexes past the end (`compression/b44/mod.rs`). All other damage that the
    // tests below try comes back as an error. Only the chunk, which is moved in, can be left inconsistent by a panic.
    let caught = catch_unwind(AssertUnwindSafe(|| UncompressedBlock::decompress_chunk(chunk, meta, false)));
    match caught {
        Ok(block) => Ok(block?),
        Err(_) => Err(Failure::File("damaged OpenEXR file: a chunk cannot be decompressed".into())),
    }
}

fn pixels_of(size: Vec2<usize>) -> u64 {
    (size.0 as u64).saturating_mul(size.1 as u64)
}

/// The part, and the name prefix of the channels R, G, B, that are read.
fn choose(headers: &[Header]) -> Result<(usize, String), String> {
    let mut found = Vec::new();
    for (i, header) in headers.iter().enumerate().filter(|(_, h)| !h.deep) {
        let names: HashSet<String> = header.channels.list.iter().map(|c| c.name.to_string()).collect();
        let prefixes = header.channels.list.iter().filter_map(|c| {
            let name = c.name.to_string();
            let prefix = name.strip_suffix('R')?;
            let whole = prefix.is_empty() || prefix.ends_with('.');
            (whole && "GB".chars().all(|l| names.contains(&format!("{prefix}{l}"))))
                .then(|| prefix.to_owned())
        });
        found.extend(prefixes.map(|p| (i, p)));
    }
    let unnamed = found.iter().position(|(_, p)| p.is_empty());
    // What Blender's compositor made comes before the view layers that it made it of. Of several layers none is the picture.
    let composite = || found.iter().position(|(_, p)| p == "Composite.Combined.");
    let combined = || {
        let mut all =
            found.iter().enumerate().filter(|(_, (_, p))| p == "Combined." || p.ends_with(".Combined."));
        all.next().filter(|_| all.next().is_none()).map(|(i, _)| i)
    };
    match unnamed.or_else(composite).or_else(combined) {
        Some(i) => Ok(found.swap_remove(i)),
        None if found.len() == 1 => Ok(found.remove(0)),
        None if found.is_empty() => {
            let names = headers.iter().flat_map(|h| &h.channels.list).map(|c| c.name.to_string());
            let names: Vec<_> = names.take(20).collect();
            Err(format!("expected flat channels R, G and B, got {:?}", names.join(", ")))
        }
        None => {
            let names: Vec<_> =
                found.iter().take(20).map(|(_, p)| format!("{:?}", p.trim_end_matches('.'))).collect();
            Err(format!(
                "expected channels R, G and B or one layer that has them, got layers {}",
                names.join(", ")
            ))
        }
    }
}

/// The destination of each channel of the header.
fn places_of(header: &Header, prefix: &str) -> Result<Vec<Option<ChannelTarget>>, String> {
    let has = |name: &str| header.channels.list.iter().any(|c| c.name.eq(name));
    let whole = |prefix: &str, letters: &str| letters.chars().all(|l| has(&format!("{prefix}{l}")));
    let place = |name: &str| {
        if let Some(rest) = name.strip_prefix(prefix)
            && let Some(c) = ["R", "G", "B"].iter().position(|&l| l == rest)
        {
            return Some(ChannelTarget::Color(c));
        }
        if name.strip_prefix(prefix) == Some("A") {
            return Some(ChannelTarget::Alpha);
        }
        if let Some(rest) = name.strip_prefix(NOISY_LAYER)
            && let Some(c) = ["R", "G", "B"].iter().position(|&l| l == rest)
        {
            return whole(NOISY_LAYER, "RGB").then_some(ChannelTarget::Noisy(c));
        }
        if name == INSTANCE_CHANNEL {
            return Some(ChannelTarget::Instance);
        }
        Pass::ALL.iter().find_map(|&pass| {
            let (prefix, letters) = channels_of_pass(pass);
            let rest = name.strip_prefix(prefix)?;
            if Pass::MATTES.contains(&pass) {
                let (number, letter) = rest.split_once('.')?;
                let c = letters.find(letter).filter(|_| letter.len() == 1)?;
                let layer = number_of_layer(number)?;
                // Without gaps, so that no number asks for more memory than the file's channels do.
                let are_there = (0..=layer).all(|n| whole(&format!("{prefix}{n:02}."), letters));
                return are_there.then_some(ChannelTarget::Matte(pass, layer, c));
            }
            match (pass, letters.len()) {
                (Pass::Label, _) => (rest == letters).then_some(ChannelTarget::Label),
                (_, 1) => (rest == letters).then_some(ChannelTarget::Number(pass)),
                _ => {
                    let c = letters.find(rest).filter(|_| rest.len() == 1)?;
                    whole(prefix, letters).then_some(ChannelTarget::Triple(pass, c))
                }
            }
        })
    };
    let mut places = Vec::with_capacity(header.channels.list.len());
    for channel in &header.channels.list {
        let name = channel.name.to_string();
        if channel.sampling != Vec2(1, 1) {
            return Err(format!("channel {name:?} is subsampled, which is not supported"));
        }
        let place = place(&name);
        let is_whole = matches!(place, Some(ChannelTarget::Label | ChannelTarget::Instance));
        if is_whole && channel.sample_type != SampleType::U32 {
            return Err(format!("channel {name}: expected whole numbers (UINT), got floats"));
        }
        if matches!(place, Some(ChannelTarget::Matte(..))) && channel.sample_type != SampleType::F32 {
            return Err(format!("channel {name:?}: expected 32 bit floats (FLOAT), in which ids are exact"));
        }
        places.push(place);
    }
    Ok(places)
}

/// Parses a layer's number of two digits.
fn number_of_layer(digits: &str) -> Option<usize> {
    (digits.len() == 2 && digits.bytes().all(|b| b.is_ascii_digit())).then(|| digits.parse().ok())?
}

/// The names of the ids of a file's matte; empty if the file has no manifest.
fn names_of_mattes(header: &Header) -> Result<BTreeMap<Pass, BTreeMap<String, u32>>, String> {
    let mut names = BTreeMap::new();
    for &pass in Pass::MATTES {
        let name = format!("cryptomatte/{}/manifest", cryptomatte::key_of(channels_of_pass(pass).0));
        if let Some(AttributeValue::Text(text)) = header.own_attributes.other.get(&Text::from(name.as_str()))
        {
            let read = cryptomatte::names_of(text.as_slice());
            names.insert(pass, read.map_err(|e| format!("attribute {name}: {e}"))?);
        }
    }
    Ok(names)
}

fn labels_of_header(header: &Header) -> Result<Vec<InstanceLabels>, String> {
    match header.own_attributes.other.get(&Text::from(LABELS_KEY)) {
        Some(AttributeValue::Text(text)) => labels_of(text.as_slice()),
        _ => Ok(Vec::new()),
    }
}

fn provenance_of(header: &Header) -> Result<Option<Provenance>, String> {
    match header.own_attributes.other.get(&Text::from(PROVENANCE_KEY)) {
        Some(AttributeValue::Text(text)) => {
            serde_json::from_slice(text.as_slice()).map(Some).map_err(|e| e.to_string())
        }
        _ => Ok(None),
    }
}

/// The picture while its channels are being filled.
struct Planes {
    width: usize,
    height: usize,
    color: Vec<[f32; 3]>,
    noisy: Option<Vec<[f32; 3]>>,
    alpha: Option<Vec<f32>>,
    label: Option<Vec<u32>>,
    instance: Option<Vec<u32>>,
    triples: BTreeMap<Pass, Vec<[f32; 3]>>,
    numbers: BTreeMap<Pass, Vec<f32>>,
    mattes: BTreeMap<Pass, Vec<Vec<[f32; 4]>>>,
}

impl Planes {
    fn new(width: usize, height: usize, places: &[Option<ChannelTarget>]) -> Result<Self, String> {
        fn filled<T: Clone>(pixels: usize, value: T) -> Result<Vec<T>, String> {
            let mut plane =
                reserved(pixels, "a channel of the picture").map_err(|e: NoMemory| e.to_string())?;
            plane.resize(pixels, value);
            Ok(plane)
        }
        let pixels = width * height;
        let has = |place| places.contains(&Some(place));
        let (mut triples, mut numbers) = (BTreeMap::new(), BTreeMap::new());
        for &pass in Pass::ALL {
            if has(ChannelTarget::Triple(pass, 0)) {
                triples.insert(pass, filled(pixels, [0.0; 3])?);
            }
            if has(ChannelTarget::Number(pass)) {
                let nothing = if pass == Pass::Depth { f32::INFINITY } else { 0.0 };
                numbers.insert(pass, filled(pixels, nothing)?);
            }
        }
        let mut mattes = BTreeMap::new();
        for &pass in Pass::MATTES {
            let layers = (0..100).take_while(|&n| has(ChannelTarget::Matte(pass, n, 0)));
            let layers: Vec<_> = layers.map(|_| filled(pixels, [0.0; 4])).collect::<Result<_, _>>()?;
            if !layers.is_empty() {
                mattes.insert(pass, layers);
            }
        }
        Ok(Self {
            width,
            height,
            mattes,
            color: filled(pixels, [0.0; 3])?,
            noisy: has(ChannelTarget::Noisy(0)).then(|| filled(pixels, [0.0; 3])).transpose()?,
            alpha: has(ChannelTarget::Alpha).then(|| filled(pixels, 0.0)).transpose()?,
            label: has(ChannelTarget::Label).then(|| filled(pixels, 0)).transpose()?,
            instance: has(ChannelTarget::Instance).then(|| filled(pixels, 0)).transpose()?,
            triples,
            numbers,
        })
    }

    /// Copies a line of samples, in native byte order, to the pixels from (x, y) on; samples outside the picture are skipped.
    fn put(&mut self, place: ChannelTarget, kind: SampleType, [x, y]: [i64; 2], bytes: &[u8]) {
        if y < 0 || y >= self.height as i64 {
            return;
        }
        let row = y as usize * self.width..(y as usize + 1) * self.width;
        let triple =
            |plane: &mut [[f32; 3]], c: usize| copy(&mut plane[row.clone()], x, kind, bytes, |p, v| p[c] = v);
        let whole = |p: &mut Vec<u32>| {
            let values = bytes.as_chunks().0.iter().map(|b| u32::from_ne_bytes(*b));
            place_line(&mut p[row.clone()], x, values, |l, v| *l = v);
        };
        let number = |p: &mut Vec<f32>| copy(&mut p[row.clone()], x, kind, bytes, |n, v| *n = v);
        match place {
            ChannelTarget::Color(c) => triple(&mut self.color, c),
            ChannelTarget::Noisy(c) => self.noisy.iter_mut().for_each(|p| triple(p, c)),
            ChannelTarget::Triple(pass, c) => {
                self.triples.get_mut(&pass).into_iter().for_each(|p| triple(p, c))
            }
            ChannelTarget::Number(pass) => self.numbers.get_mut(&pass).into_iter().for_each(number),
            ChannelTarget::Matte(pass, layer, c) => {
                let layer = self.mattes.get_mut(&pass).and_then(|layers| layers.get_mut(layer));
                layer.into_iter().for_each(|p| copy(&mut p[row.clone()], x, kind, bytes, |p, v| p[c] = v));
            }
            ChannelTarget::Alpha => self.alpha.iter_mut().for_each(number),
            ChannelTarget::Label => self.label.iter_mut().for_each(whole),
            ChannelTarget::Instance => self.instance.iter_mut().for_each(whole),
        }
    }

    fn into_picture(
        mut self,
        provenance: Option<Provenance>,
        mut names: BTreeMap<Pass, BTreeMap<String, u32>>,
    ) -> Picture {
        let mut matte =
            |(pass, layers)| Matte { pass, layers, names: names.remove(&pass).unwrap_or_default() };
        let image = |pixels| Image::new(self.width, self.height, pixels);
        Picture {
            noisy: self.noisy.map(image),
            variance: self.triples.remove(&Pass::Variance).map(image),
            depth: self.numbers.remove(&Pass::Depth),
            label: self.label,
            instance: self.instance,
            albedo: self.triples.remove(&Pass::Albedo).map(image),
            normal: self.triples.remove(&Pass::Normal).map(image),
            alpha: self.alpha,
            position: self.triples.remove(&Pass::Position).map(image),
            samples: self.numbers.remove(&Pass::Samples),
            light: self.triples.into_iter().map(|(pass, pixels)| (pass, image(pixels))).collect(),
            mattes: self.mattes.into_iter().map(&mut matte).collect(),
            provenance,
            ..Picture::of(image(self.color))
        }
    }
}

/// Decodes samples of any type to floats and puts them into a row from column `x` on.
fn copy<T>(row: &mut [T], x: i64, kind: SampleType, bytes: &[u8], put: impl Fn(&mut T, f32)) {
    match kind {
        SampleType::F32 => {
            place_line(row, x, bytes.as_chunks().0.iter().map(|b| f32::from_ne_bytes(*b)), put);
        }
        SampleType::F16 => {
            place_line(row, x, bytes.as_chunks().0.iter().map(|b| f16::from_ne_bytes(*b).to_f32()), put);
        }
        SampleType::U32 => {
            place_line(row, x, bytes.as_chunks().0.iter().map(|b| u32::from_ne_bytes(*b) as f32), put);
        }
    }
}

fn place_line<T, V>(row: &mut [T], x: i64, values: impl Iterator<Item = V>, put: impl Fn(&mut T, V)) {
    let skipped_values = usize::try_from(-x).unwrap_or(0);
    let skipped_pixels = usize::try_from(x).unwrap_or(0);
    for (pixel, value) in row.iter_mut().skip(skipped_pixels).zip(values.skip(skipped_values)) {
        put(pixel, value);
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use exr::prelude::{
        AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image as ExrImage,
        IntegerBounds, Layer, LayerAttributes, LineOrder, WritableImage,
    };

    use super::*;
    use crate::{Passes, sample_pictures, write_exr};

    /// Bytes of a small file written by this crate, with every pass.
    fn ours() -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        write_exr(&path, &sample_pictures::picture(6, 18), &Passes::ALL).unwrap();
        std::fs::read(path).unwrap()
    }

    fn parse(bytes: &[u8]) -> Result<Picture, Failure> {
        read_from(Cursor::new(bytes), bytes.len() as u64)
    }

    /// Files of every `step`th length must be refused.
    fn truncate(step: usize) {
        let bytes = ours();
        assert!(parse(&bytes).is_ok());
        for length in (0..bytes.len()).step_by(step) {
            match parse(&bytes[..length]) {
                Err(Failure::File(what)) => assert!(!what.contains('\n'), "{what}"),
                other => panic!("{length} of {} bytes: {other:?}", bytes.len()),
            }
        }
    }

    #[test]
    fn truncations_are_refused() {
        truncate(11);
        let bytes = ours();
        assert!(parse(&bytes[..bytes.len() - 1]).is_err());
    }

    #[test]
    #[ignore = "full: a dozen seconds"]
    fn every_truncation_is_refused() {
        truncate(1);
    }

    /// Flips every `step`th bit. No damage may cause a panic.
    fn flip_bits(step: usize) {
        let bytes = ours();
        let (mut refused, flips) = (0, (0..bytes.len() * 8).step_by(step));
        for i in flips.clone() {
            let mut damaged = bytes.clone();
            damaged[i / 8] ^= 1 << (i % 8);
            refused += usize::from(parse(&damaged).is_err());
        }
        assert!(refused > flips.len() / 8, "{refused} of {} flips refused", flips.len());
    }

    /// Bits of all kinds: 67 has no factor in common with the 8 of a byte.
    #[test]
    fn no_flipped_bit_panics() {
        flip_bits(67);
    }

    #[test]
    #[ignore = "full: minutes"]
    fn none_of_all_flipped_bits_panics() {
        flip_bits(1);
    }

    /// Larger damage at every `step`th byte: words set to extremes, and bytes left out.
    fn damage_words(step: usize) {
        let bytes = ours();
        for at in (0..bytes.len() - 4).step_by(step) {
            for word in [0u32, 1, 0x7FFF_FFFF, 0x8000_0000, 0xFFFF_FFFF, 0x0001_0000] {
                let mut damaged = bytes.clone();
                damaged[at..at + 4].copy_from_slice(&word.to_le_bytes());
                let _ = parse(&damaged);
            }
            let mut shorter = bytes.clone();
            shorter.drain(at..at + 4);
            let _ = parse(&shorter);
        }
    }

    #[test]
    fn no_coarse_damage_panics() {
        damage_words(67);
    }

    #[test]
    #[ignore = "full: minutes"]
    fn no_coarse_damage_anywhere_panics() {
        damage_words(1);
    }

    fn channel(name: &str, samples: FlatSamples) -> AnyChannel<FlatSamples> {
        AnyChannel::new(name, samples)
    }

    fn half(values: impl Iterator<Item = f32>) -> FlatSamples {
        FlatSamples::F16(values.map(f16::from_f32).collect())
    }

    #[test]
    fn no_damage_to_other_kinds_of_files_panics() {
        use Compression as C;
        let mut state = 1u64;
        let mut random = move |below: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) as usize) % below
        };
        for compression in [C::Uncompressed, C::RLE, C::ZIP1, C::PIZ, C::PXR24, C::B44, C::B44A] {
            for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(32, 16))] {
                let bytes = foreign("", compression, blocks);
                for _ in 0..400 {
                    let mut damaged = bytes.clone();
                    for _ in 0..=random(3) {
                        // Half of the damage goes to the headers and the offset table.
                        let below = if random(2) == 0 { 600 } else { bytes.len() };
                        damaged[random(below)] ^= 1 << random(8);
                    }
                    let _ = parse(&damaged);
                }
            }
        }
    }

    /// A file as other programs write it: half floats, any compression, tiles or scan lines, a prefix on the names.
    fn foreign(prefix: &str, compression: Compression, blocks: Blocks) -> Vec<u8> {
        let n = 70 * 50;
        let list = ["A", "B", "G", "R"].iter().enumerate().map(|(c, l)| {
            channel(&format!("{prefix}{l}"), half((0..n).map(|i| (c * 10_000 + i) as f32 / 64.0)))
        });
        let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
        let channels = AnyChannels::sort(list.collect());
        let mut bytes = Cursor::new(Vec::new());
        let layer = Layer::new((70, 50), LayerAttributes::named("x"), encoding, channels);
        ExrImage::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn other_programs_files_open() {
        for prefix in ["", "ViewLayer.Combined.", "beauty."] {
            for compression in
                [Compression::Uncompressed, Compression::RLE, Compression::ZIP1, Compression::PIZ]
            {
                for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(32, 16))] {
                    let picture = parse(&foreign(prefix, compression, blocks)).unwrap();
                    assert_eq!((picture.color.width, picture.color.height), (70, 50));
                    for (i, pixel) in picture.color.pixels.iter().enumerate() {
                        let expected =
                            [3, 2, 1].map(|c| f16::from_f32((c * 10_000 + i) as f32 / 64.0).to_f32());
                        assert_eq!(*pixel, expected, "{prefix} {compression:?} {blocks:?}: pixel {i}");
                    }
                    assert_eq!(picture.provenance, None);
                }
            }
        }
    }

    #[test]
    fn a_cropped_file_lies_in_its_display_window() {
        let names = ["B", "G", "R"];
        let samples = || FlatSamples::F32((0..6).map(|i| i as f32 + 1.0).collect());
        let channels = AnyChannels::sort(names.iter().map(|n| channel(n, samples())).collect());
        // Data of 3 × 2 pixels, of which the first column lies left of a display window of 4 × 3.
        let attributes = LayerAttributes::named("x").with_position(Vec2(9, 21));
        let layer = Layer::new((3, 2), attributes, Encoding::UNCOMPRESSED, channels);
        let mut image = ExrImage::from_layer(layer);
        image.attributes.display_window = IntegerBounds::new((10, 20), (4, 3));
        let mut bytes = Cursor::new(Vec::new());
        image.write().to_buffered(&mut bytes).unwrap();
        let picture = parse(&bytes.into_inner()).unwrap();
        let red: Vec<f32> = picture.color.pixels.iter().map(|p| p[0]).collect();
        assert_eq!(red, [0., 0., 0., 0., 2., 3., 0., 0., 5., 6., 0., 0.]);
    }

    #[test]
    fn what_is_no_picture_is_refused_in_one_line() {
        let one = |name: &str| channel(name, half([1.0].into_iter()));
        let write = |list: Vec<AnyChannel<FlatSamples>>| {
            let mut bytes = Cursor::new(Vec::new());
            let channels = AnyChannels::sort(list.into_iter().collect());
            ExrImage::from_channels((1, 1), channels).write().to_buffered(&mut bytes).unwrap();
            bytes.into_inner()
        };
        let luminance = write(vec![one("Y")]);
        let two = write(["a.R", "a.G", "a.B", "b.R", "b.G", "b.B"].map(one).to_vec());
        let of = |name: &str| ["R", "G", "B"].map(|l| one(&format!("{name}.{l}")));
        let layers = write([of("A.Combined"), of("B.Combined"), of("B.Normal")].concat());
        assert!(parse(&write([of("A.Combined"), of("Composite.Combined")].concat())).is_ok());
        let float_label = write(["R", "G", "B", "label.index"].map(one).to_vec());
        let matte = |l: &str| format!("ViewLayer.CryptoObject00.{l}");
        let ids = write(
            "rgba".chars().map(|l| one(&matte(&l.to_string()))).chain(["R", "G", "B"].map(one)).collect(),
        );
        for (bytes, expected) in [
            (luminance.as_slice(), "expected flat channels R, G and B, got \"Y\""),
            (&two, "one layer that has them, got layers \"a\", \"b\""),
            (&layers, "one layer that has them, got layers \"A.Combined\", \"B.Combined\""),
            (&float_label, "label.index: expected whole numbers"),
            (&ids, "expected 32 bit floats (FLOAT), in which ids are exact"),
            (b"P6 1 1 255 abc", "expected an OpenEXR file"),
            (b"", "expected an OpenEXR file"),
            (&two[..60], "damaged OpenEXR file"),
        ] {
            match parse(bytes) {
                Err(Failure::File(what)) => {
                    assert!(what.contains(expected) && !what.contains('\n'), "{what}")
                }
                other => panic!("{expected}: {other:?}"),
            }
        }
    }

    #[test]
    fn claimed_sizes_are_checked_before_memory_is_reserved() {
        let bytes = foreign("", Compression::ZIP1, Blocks::ScanLines);
        let name = b"displayWindow\0box2i\0";
        let at = bytes.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4;
        for (side, expected) in [(70_000u32, "at most"), (30_000, "cannot hold")] {
            let mut huge = bytes.clone();
            for corner in [8, 12] {
                huge[at + corner..at + corner + 4].copy_from_slice(&(side - 1).to_le_bytes());
            }
            match parse(&huge) {
                Err(Failure::File(what)) => assert!(what.contains(expected), "{what}"),
                other => panic!("{side}: {other:?}"),
            }
        }
    }
}
