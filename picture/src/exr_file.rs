//! Writes pictures as OpenEXR files: one part, lossless, with a group of channels for each pass.
//!
//! | channels | type | what |
//! |---|---|---|
//! | `R`, `G`, `B` | float | scene-linear Rec. 709 radiance |
//! | `ViewLayer.Noisy Image.R`, `.G`, `.B` | float | the same before denoising, where the picture is denoised and any pass is written |
//! | `A` | float | share of the samples that hit a surface, for a transparent film; the colour is premultiplied |
//! | `ViewLayer.Depth.Z` | float | distance along the view axis to the first surface, +inf where there is none |
//! | `label.index` | uint | dense index of the label of the first surface + 1, 0 where there is none |
//! | `label.instance` | uint | id of the instance of that label, in a scene of several |
//! | `ViewLayer.Position.X`, `.Y`, `.Z` | float | world position of the first surface |
//! | `ViewLayer.CryptoObject00.r`, `.g`, `.b`, `.a`, … | float | ids and coverages by label, `CryptoAsset` by type: [`crate::cryptomatte`] |
//! | `ViewLayer.DiffDir.R`, `.G`, `.B`, … | float | the other passes of `docs/passes.md`, under the names that Blender gives them |
//!
//! [`write_exr_half`] writes colours, alpha, normals and albedo as half floats.
//!
//! The colour channels have no layer name, so that every program shows them; the passes have the name of Blender's first view layer,
//! so that compositor set-ups find them. Labels are 32-bit integers and are never converted to float. The attribute `pumice` (a string)
//! holds [`crate::Provenance`] as JSON in ASCII, `pumiceLabels` the ids of the labels ([`crate::InstanceLabels`]): an EXR string has no encoding, so other characters are escaped as `\uXXXX`. Scan
//! `xDensity` is the density on paper, `pixelAspectRatio` that of the film. A picture's [marks](crate::annotate) are drawn over the colour. Scan
//! lines, ZIP in blocks of 16. Attributes are sorted by name. The bytes depend on the picture alone: no date, no hash map order.

use std::io::{Seek, Write};
use std::path::Path;

use exr::block::UncompressedBlock;
use exr::block::writer::ChunksWriter;
use exr::meta::attribute::{AttributeValue, ChannelDescription, Chromaticities, SampleType, Text};
use exr::meta::header::{Header, ImageAttributes, LayerAttributes};
use exr::prelude::{Compression, LineOrder, Vec2, f16};
use pumice_core::write_atomically;

use crate::annotate::drawn_over;
use crate::cryptomatte::{self, Matte};
use crate::exr_header::SortedHeader;
use crate::exr_read;
use crate::picture_labels::LABELS_KEY;
use crate::provenance_paths::{PicturePaths, for_file};
use crate::provenance_text::{PROVENANCE_KEY, json_in_ascii, provenance_to_ascii};
use crate::{Image, Pass, Passes, Picture, PictureError, Provenance};

/// The source of a channel's samples.
#[derive(Clone, Copy)]
enum Samples<'a> {
    Of(&'a Image, usize),
    HalfOf(&'a Image, usize),
    HalfFloats(&'a [f32]),
    OfFour(&'a [[f32; 4]], usize),
    Floats(&'a [f32]),
    Whole(&'a [u32]),
}

/// Writes the picture and those of `passes` that it has, as 32-bit floats. The file appears complete or not at all.
///
/// # Errors
/// [`PictureError::Io`] for an error of the system, [`PictureError::File`] when the picture does not fit the format or its passes
/// have different sizes.
pub fn write_exr(path: &Path, picture: &Picture, passes: &Passes) -> Result<(), PictureError> {
    write_exr_as(path, picture, passes, false, PicturePaths::Relative)
}

/// As [`write_exr`], with colours as 16-bit floats, rounded to the nearest, ties to even. Values beyond ±65,504 are clamped, as Blender
/// does: an infinity would spread through every filter of a compositor. Depth, position, label, mattes, variance and samples keep
/// 32 bits.
///
/// # Errors
/// As [`write_exr`].
pub fn write_exr_half(path: &Path, picture: &Picture, passes: &Passes) -> Result<(), PictureError> {
    write_exr_as(path, picture, passes, true, PicturePaths::Relative)
}

/// As [`write_exr_half`] if `half`, otherwise as [`write_exr`]; `paths` says what the file tells of where its sources are.
///
/// # Errors
/// As [`write_exr`].
pub fn write_exr_as(
    path: &Path,
    picture: &Picture,
    passes: &Passes,
    half: bool,
    paths: PicturePaths,
) -> Result<(), PictureError> {
    let made = picture.provenance.as_ref().map(|made| for_file(made, path, paths));
    write_atomically(path, |file| write_to(file, path, picture, made.as_ref(), passes, half))
}

/// Whether a pass holds colours, or other values for which 16 bits are enough.
fn may_be_half(pass: Pass) -> bool {
    matches!(pass, Pass::Albedo | Pass::Normal | Pass::ShadowCatcher) || Pass::LIGHT.contains(&pass)
}

/// The nearest 16-bit float.
fn half_of(value: f32) -> f16 {
    f16::from_f32(value.clamp(-f16::MAX.to_f32(), f16::MAX.to_f32()))
}

/// Reads a picture: one that [`write_exr`] wrote, or any EXR with channels R, G and B, half or float, tiles or scan lines.
///
/// If several parts or layers have R, G and B, the unnamed one is taken, otherwise what Blender's compositor made (`Composite.Combined`),
/// otherwise the one called `Combined` of a single view layer, otherwise the only one.
/// The picture spans the display window; it is black where the file has no data.
///
/// # Errors
/// [`PictureError::Io`] for an error of the system, [`PictureError::File`] when the file is damaged, has no such channels, or is
/// larger than 65,536 pixels per side or 2³⁰ pixels.
pub fn read_exr(path: &Path) -> Result<Picture, PictureError> {
    exr_read::read(path)
}

/// Name of the second channel of the label pass.
pub(crate) const INSTANCE_CHANNEL: &str = "label.instance";

/// Layer of the mean of the samples, in a file whose colour is denoised: its name in Blender.
pub(crate) const NOISY_LAYER: &str = "ViewLayer.Noisy Image.";

/// The layer name of a pass and the suffixes of its channels.
pub(crate) fn channels_of_pass(pass: Pass) -> (&'static str, &'static str) {
    match pass {
        Pass::Depth => ("ViewLayer.Depth.", "Z"),
        Pass::Position => ("ViewLayer.Position.", "XYZ"),
        Pass::Normal => ("ViewLayer.Normal.", "XYZ"),
        // Blender has no integer channels.
        Pass::Label => ("label.", "index"),
        Pass::Albedo => ("ViewLayer.Denoising Albedo.", "RGB"),
        Pass::DiffuseDirect => ("ViewLayer.DiffDir.", "RGB"),
        Pass::DiffuseIndirect => ("ViewLayer.DiffInd.", "RGB"),
        Pass::DiffuseColor => ("ViewLayer.DiffCol.", "RGB"),
        Pass::GlossyDirect => ("ViewLayer.GlossDir.", "RGB"),
        Pass::GlossyIndirect => ("ViewLayer.GlossInd.", "RGB"),
        Pass::GlossyColor => ("ViewLayer.GlossCol.", "RGB"),
        Pass::TransmissionDirect => ("ViewLayer.TransDir.", "RGB"),
        Pass::TransmissionIndirect => ("ViewLayer.TransInd.", "RGB"),
        Pass::TransmissionColor => ("ViewLayer.TransCol.", "RGB"),
        Pass::Emission => ("ViewLayer.Emit.", "RGB"),
        Pass::Environment => ("ViewLayer.Env.", "RGB"),
        Pass::ShadowCatcher => ("ViewLayer.Shadow Catcher.", "RGB"),
        // The layer's number is inserted between the two. Lower-case names keep compositors from treating the channels as colours.
        Pass::CryptomatteLabel => ("ViewLayer.CryptoObject", "rgba"),
        Pass::CryptomatteType => ("ViewLayer.CryptoAsset", "rgba"),
        Pass::Variance => ("ViewLayer.Variance.", "RGB"),
        Pass::Samples => ("ViewLayer.Debug Sample Count.", "X"),
    }
}

/// The channels of the file, sorted by name as the format requires.
fn channels_of<'a>(
    picture: &'a Picture,
    (color, alpha): (&'a Image, Option<&'a [f32]>),
    passes: &Passes,
    half: bool,
) -> Vec<(String, Samples<'a>)> {
    fn triple<'a>(
        of: &mut Vec<(String, Samples<'a>)>,
        prefix: &str,
        letters: &str,
        image: &'a Image,
        half: bool,
    ) {
        let samples = |c| if half { Samples::HalfOf(image, c) } else { Samples::Of(image, c) };
        of.extend(letters.chars().enumerate().map(|(c, l)| (format!("{prefix}{l}"), samples(c))));
    }
    let mut channels = Vec::new();
    triple(&mut channels, "", "RGB", color, half);
    if let Some(noisy) = picture.noisy.as_ref().filter(|_| *passes != Passes::NONE) {
        triple(&mut channels, NOISY_LAYER, "RGB", noisy, half);
    }
    let share = |of| if half { Samples::HalfFloats(of) } else { Samples::Floats(of) };
    channels.extend(alpha.map(|of| ("A".into(), share(of))));
    for pass in passes.iter() {
        let (layer, letters) = channels_of_pass(pass);
        let name = || format!("{layer}{letters}");
        let image = match pass {
            Pass::Depth | Pass::Samples => {
                let of = if pass == Pass::Depth { &picture.depth } else { &picture.samples };
                channels.extend(of.as_ref().map(|of| (name(), Samples::Floats(of))));
                None
            }
            Pass::Label => {
                channels.extend(picture.label.as_ref().map(|of| (name(), Samples::Whole(of))));
                let instance = picture.instance.as_ref().filter(|_| picture.label.is_some());
                channels.extend(instance.map(|of| (INSTANCE_CHANNEL.into(), Samples::Whole(of))));
                None
            }
            Pass::CryptomatteLabel | Pass::CryptomatteType => {
                for matte in picture.mattes.iter().filter(|m| m.pass == pass) {
                    for (number, pixels) in matte.layers.iter().enumerate() {
                        let of = letters.chars().enumerate();
                        let named = |(c, l)| (format!("{layer}{number:02}.{l}"), Samples::OfFour(pixels, c));
                        channels.extend(of.map(named));
                    }
                }
                None
            }
            Pass::Variance => picture.variance.as_ref(),
            Pass::Albedo => picture.albedo.as_ref(),
            Pass::Normal => picture.normal.as_ref(),
            Pass::Position => picture.position.as_ref(),
            light => picture.light.iter().find(|(pass, _)| *pass == light).map(|(_, image)| image),
        };
        if let Some(image) = image {
            triple(&mut channels, layer, letters, image, half && may_be_half(pass));
        }
    }
    channels.sort_by(|a, b| a.0.cmp(&b.0));
    channels
}

fn write_to(
    writer: &mut (impl Write + Seek),
    path: &Path,
    picture: &Picture,
    provenance: Option<&Provenance>,
    passes: &Passes,
    half: bool,
) -> Result<(), PictureError> {
    let refuse = |what: String| PictureError::File { path: path.to_owned(), what };
    let (width, height) = (picture.color.width, picture.color.height);
    let (color, alpha) = drawn_over(picture).map_err(|e| refuse(e.to_string()))?;
    let channels = channels_of(picture, (&color, alpha.as_deref()), passes, half);
    check_size(width, height).map_err(refuse)?;
    for (name, samples) in &channels {
        let fits = match samples {
            Samples::Of(image, _) | Samples::HalfOf(image, _) => {
                (image.width, image.height) == (width, height)
            }
            Samples::OfFour(of, _) => of.len() == width * height,
            Samples::Floats(of) | Samples::HalfFloats(of) => of.len() == width * height,
            Samples::Whole(of) => of.len() == width * height,
        };
        if !fits {
            return Err(refuse(format!("channel {name}: expected {width} × {height} samples")));
        }
    }
    let header = header_of(picture, provenance, passes, &channels).map_err(refuse)?;
    exr::block::write(SortedHeader::new(writer), [header].into_iter().collect(), true, |meta, chunks| {
        let blocks = meta.collect_ordered_blocks(|block| {
            UncompressedBlock::from_lines(&meta.headers[block.layer].channels, block, |line| {
                let first = line.location.position.1 * width + line.location.position.0;
                // The crate asks for each line in the order of the header's channels, which is that of `channels`; lines hold
                // samples in the machine's byte order.
                let bytes = line.value;
                match channels[line.location.channel].1 {
                    Samples::Of(image, c) => fill(bytes, &image.pixels[first..], |p| p[c].to_ne_bytes()),
                    Samples::HalfOf(image, c) => {
                        fill(bytes, &image.pixels[first..], |p| half_of(p[c]).to_ne_bytes());
                    }
                    Samples::OfFour(of, c) => fill(bytes, &of[first..], |p| p[c].to_ne_bytes()),
                    Samples::Floats(of) => fill(bytes, &of[first..], |v| v.to_ne_bytes()),
                    Samples::HalfFloats(of) => fill(bytes, &of[first..], |v| half_of(v).to_ne_bytes()),
                    Samples::Whole(of) => fill(bytes, &of[first..], |v| v.to_ne_bytes()),
                }
            })
        });
        chunks.on_progress(|_| ()).compress_all_blocks_parallel(&meta, blocks)
    })
    .map_err(|error| match error {
        exr::error::Error::Io(source) => PictureError::Io { path: path.to_owned(), source },
        other => refuse(format!("cannot be written: {other}")),
    })
}

fn fill<T: Copy, const N: usize>(bytes: &mut [u8], samples: &[T], encode: impl Fn(T) -> [u8; N]) {
    for (to, &from) in bytes.as_chunks_mut().0.iter_mut().zip(samples) {
        *to = encode(from);
    }
}

fn header_of(
    picture: &Picture,
    provenance: Option<&Provenance>,
    passes: &Passes,
    channels: &[(String, Samples<'_>)],
) -> Result<Header, String> {
    let size = (picture.color.width, picture.color.height);
    let list = channels.iter().map(|(name, samples)| {
        let kind = match samples {
            Samples::Whole(_) => SampleType::U32,
            Samples::HalfOf(..) | Samples::HalfFloats(_) => SampleType::F16,
            Samples::Of(..) | Samples::OfFour(..) | Samples::Floats(_) => SampleType::F32,
        };
        ChannelDescription::new(name.as_str(), kind, false)
    });
    let mut layer = LayerAttributes {
        software_name: Some(Text::from(concat!("Pumice ", env!("CARGO_PKG_VERSION")))),
        horizontal_density: picture.dpi.map(|dpi| dpi as f32),
        ..LayerAttributes::default()
    };
    if let Some(provenance) = provenance {
        let json = Text::from(provenance_to_ascii(provenance)?.as_str());
        layer.other.insert(Text::from(PROVENANCE_KEY), AttributeValue::Text(json));
    }
    if passes.has(Pass::Label) && picture.label.is_some() && !picture.labels.is_empty() {
        let json = Text::from(json_in_ascii(&picture.labels).map_err(|e| format!("labels: {e}"))?.as_str());
        layer.other.insert(Text::from(LABELS_KEY), AttributeValue::Text(json));
    }
    for matte in picture.mattes.iter().filter(|m| passes.has(m.pass)) {
        for (name, value) in attributes_of(matte)? {
            let value = AttributeValue::Text(Text::from_slice_unchecked(value.as_bytes()));
            layer.other.insert(Text::from(name.as_str()), value);
        }
    }
    let mut shared = ImageAttributes::with_size(size);
    if let Some(made) = &picture.provenance {
        shared.pixel_aspect = made.scene.film.pixel_aspect as f32;
    }
    // Rec. 709 primaries and white, ITU-R BT.709-6 table 1.
    shared.chromaticities = Some(Chromaticities {
        red: Vec2(0.64, 0.33),
        green: Vec2(0.30, 0.60),
        blue: Vec2(0.15, 0.06),
        white: Vec2(0.3127, 0.3290),
    });
    Ok(Header::new(Text::from("picture"), size, list.collect())
        .with_encoding(Compression::ZIP16, exr::meta::BlockDescription::ScanLines, LineOrder::Increasing)
        .with_attributes(layer)
        .with_shared_attributes(shared))
}

/// The attributes of a matte, by name: see [`cryptomatte`].
pub(crate) fn attributes_of(matte: &Matte) -> Result<[(String, String); 4], String> {
    let (layers, _) = channels_of_pass(matte.pass);
    let of = |what: &str| format!("cryptomatte/{}/{what}", cryptomatte::key_of(layers));
    Ok([
        (of("conversion"), "uint32_to_float32".into()),
        (of("hash"), "MurmurHash3_32".into()),
        (of("manifest"), cryptomatte::manifest(&matte.names)?),
        (of("name"), layers.into()),
    ])
}

/// Refuses sizes beyond the limits of this crate, before anything is allocated.
pub(crate) fn check_size(width: usize, height: usize) -> Result<(), String> {
    let pixels = width.saturating_mul(height);
    if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE || pixels > MAX_PIXELS {
        return Err(format!(
            "expected 1 to {MAX_SIDE} pixels a side and at most {MAX_PIXELS} in all, got {width} × {height}"
        ));
    }
    Ok(())
}

/// Greatest width and height.
const MAX_SIDE: usize = 65_536;
/// Most pixels.
const MAX_PIXELS: usize = 1 << 30;

#[cfg(test)]
mod tests {
    use std::io::{Cursor, SeekFrom};

    use super::*;
    use crate::sample_pictures;

    fn files_in(folder: &Path) -> Vec<String> {
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
    }

    /// A sample picture whose volumes are beside the file that it is written to.
    fn sample_for(path: &Path, width: usize, height: usize) -> Picture {
        let mut picture = sample_pictures::picture(width, height);
        let folder = path.parent().unwrap().canonicalize().unwrap();
        let made = picture.provenance.as_mut().unwrap();
        made.scene.paths_mut().for_each(|source| *source = folder.join(&*source));
        picture
    }

    #[test]
    fn every_pass_and_the_provenance_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        // Sizes on both sides of a block of 16 lines, and one pixel.
        for (width, height) in [(5, 4), (1, 1), (33, 16), (3, 17), (70, 40)] {
            let picture = sample_for(&path, width, height);
            write_exr(&path, &picture, &Passes::ALL).unwrap();
            assert_eq!(read_exr(&path).unwrap(), picture, "{width} × {height}");
        }
        assert_eq!(files_in(folder.path()), ["a.exr"]);
    }

    /// Half floats are the nearest value by the definition of the format (IEEE 754 binary16); other channels keep every bit.
    #[test]
    fn halves_are_the_nearest_and_only_of_colours() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let mut picture = sample_for(&path, 33, 17);
        // Halfway cases go to even; the smallest; beyond the largest; what is no number.
        picture.color.pixels[..4].copy_from_slice(&[
            [2049.0, 2051.0, 65_519.0],
            [65_520.0, -1e30, f32::INFINITY],
            [f32::from_bits(0x3300_0000), f32::from_bits(0x3300_0001), 6e-8],
            [f32::NAN, -0.0, 0.1],
        ]);
        write_exr_half(&path, &picture, &Passes::ALL).unwrap();
        let back = read_exr(&path).unwrap();
        assert_eq!(back.color.pixels[0], [2048.0, 2052.0, 65_504.0]);
        assert_eq!(back.color.pixels[1], [65_504.0, -65_504.0, 65_504.0]);
        assert_eq!(back.color.pixels[2], [0.0, 2f32.powi(-24), 2f32.powi(-24)]);
        assert!(back.color.pixels[3][0].is_nan() && back.color.pixels[3][1].to_bits() == 1 << 31);
        assert_eq!(back.color.pixels[3][2], 0.099_975_586);
        // 11 bits of significand: half of 2⁻¹⁰ of the value at most, or of 2⁻²⁴.
        let near = |a: &[f32], b: &[f32]| {
            let mut rounded = 0;
            for (a, b) in a.iter().zip(b) {
                let bound = (b.abs() * 2f32.powi(-11)).max(2f32.powi(-25));
                assert!((a - b).abs() <= bound, "{a} for {b}");
                rounded += usize::from(a != b);
            }
            assert!(rounded > a.len() / 4, "{rounded} of {} are rounded at all", a.len());
        };
        near(back.color.pixels[4..].as_flattened(), picture.color.pixels[4..].as_flattened());
        near(
            back.noisy.as_ref().unwrap().pixels.as_flattened(),
            picture.noisy.as_ref().unwrap().pixels.as_flattened(),
        );
        near(
            back.albedo.as_ref().unwrap().pixels.as_flattened(),
            picture.albedo.as_ref().unwrap().pixels.as_flattened(),
        );
        for ((pass, a), (_, b)) in back.light.iter().zip(&picture.light) {
            assert!(Pass::LIGHT.contains(pass) || *pass == Pass::ShadowCatcher);
            near(a.pixels.as_flattened(), b.pixels.as_flattened());
        }
        // Everything else is unchanged.
        let kept = Picture {
            color: picture.color.clone(),
            noisy: picture.noisy.clone(),
            albedo: picture.albedo.clone(),
            normal: picture.normal.clone(),
            alpha: picture.alpha.clone(),
            light: picture.light.clone(),
            ..back
        };
        assert_eq!(format!("{kept:?}"), format!("{picture:?}"), "as text: one is no number");
    }

    #[test]
    fn unwanted_passes_stay_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let picture = sample_for(&path, 5, 4);
        // The noisy picture is beside a denoised one wherever any pass is.
        write_exr(&path, &picture, &Passes::NONE).unwrap();
        assert_eq!(read_exr(&path).unwrap().noisy, None);
        write_exr(&path, &picture, &Passes::NONE.with(Pass::Label)).unwrap();
        let back = read_exr(&path).unwrap();
        let expected = Picture {
            noisy: picture.noisy,
            label: picture.label,
            instance: picture.instance,
            labels: picture.labels,
            dpi: picture.dpi,
            alpha: picture.alpha,
            provenance: picture.provenance,
            mattes: Vec::new(),
            ..Picture::of(picture.color)
        };
        assert_eq!(back, expected);
    }

    #[test]
    fn the_same_picture_gives_the_same_bytes() {
        let picture = sample_pictures::picture(40, 50);
        let bytes = || {
            let mut bytes = Cursor::new(Vec::new());
            write_to(
                &mut bytes,
                Path::new("a.exr"),
                &picture,
                picture.provenance.as_ref(),
                &Passes::ALL,
                false,
            )
            .unwrap();
            bytes.into_inner()
        };
        assert_eq!(bytes(), bytes());
    }

    /// Signed zeros and the payloads of NaNs too: the file is lossless in every bit.
    #[test]
    fn bits_survive() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let mut picture = sample_pictures::picture(4, 1);
        let bits = [0x7FC1_2345u32, 0x8000_0000, 0xFF80_0000];
        picture.color.pixels[2] = bits.map(f32::from_bits);
        write_exr(&path, &picture, &Passes::NONE).unwrap();
        assert_eq!(read_exr(&path).unwrap().color.pixels[2].map(f32::to_bits), bits);
    }

    #[test]
    fn refusals_leave_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let picture = sample_pictures::picture(5, 4);
        let missing = folder.path().join("no").join("a.exr");
        let error = write_exr(&missing, &picture, &Passes::ALL).unwrap_err();
        assert!(matches!(error, PictureError::Io { .. }), "{error}");
        let line = error.to_string();
        assert!(line.contains("a.exr") && line.contains("No such file") && !line.contains('\n'), "{line}");

        let error = write_exr(folder.path(), &picture, &Passes::ALL).unwrap_err().to_string();
        assert!(error.ends_with("expected an ordinary file, got a folder"), "{error}");

        let path = folder.path().join("b.exr");
        std::fs::write(&path, "before").unwrap();
        let mut odd = picture;
        odd.depth.as_mut().unwrap().pop();
        let error = write_exr(&path, &odd, &Passes::ALL).unwrap_err().to_string();
        assert!(error.ends_with("channel ViewLayer.Depth.Z: expected 5 × 4 samples"), "{error}");
        assert_eq!(std::fs::read(&path).unwrap(), b"before");
        assert_eq!(files_in(folder.path()), ["b.exr"]);
    }

    /// A writer that takes `left` bytes and then fails as a full disk does.
    struct Full {
        inner: Cursor<Vec<u8>>,
        left: usize,
    }

    impl Write for Full {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            if self.left == 0 {
                return Err(std::io::ErrorKind::StorageFull.into());
            }
            let n = bytes.len().min(self.left);
            self.left -= n;
            self.inner.write(&bytes[..n])
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    impl Seek for Full {
        fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
            self.inner.seek(to)
        }
    }

    #[test]
    fn a_full_disk_is_an_io_error_wherever_it_strikes() {
        let picture = sample_pictures::picture(30, 40);
        let write = |left| {
            let mut disk = Full { inner: Cursor::new(Vec::new()), left };
            let result = write_to(
                &mut disk,
                Path::new("a.exr"),
                &picture,
                picture.provenance.as_ref(),
                &Passes::ALL,
                false,
            );
            (result, disk.inner.into_inner().len())
        };
        let (result, whole) = write(usize::MAX);
        result.unwrap();
        for left in (0..whole).step_by(whole / 40) {
            let error = write(left).0.unwrap_err();
            let full = matches!(&error, PictureError::Io { source, .. } if source.kind() == std::io::ErrorKind::StorageFull);
            assert!(full, "after {left} bytes: {error}");
        }
    }
}
