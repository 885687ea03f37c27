//! Small valid inputs, made by the writers, from which libFuzzer starts. They are written to the folder `PUMICE_FUZZ_SEEDS`, which
//! `cargo xtask fuzz` sets, before libFuzzer reads its corpus.

use std::path::{Path, PathBuf};

use glam::{DAffine3, DVec3};
use pumice_core::{
    AnnotationTable, CompressedVolume, CompressionLevel as Level, Job, LabelBuffer, LabelNote, LabelType,
    NumericColumn, VolumeInfo, compress_labels,
};
use pumice_formats::LabelTableFormat;
use pumice_formats::write::write_volume;
use pumice_picture::{Image, Pass, Passes, Picture, Provenance, write_exr, write_png};
use pumice_scene::Scene;

use crate::scratch;

/// Writes a target's seeds if `PUMICE_FUZZ_SEEDS` is set.
///
/// # Panics
/// When a seed cannot be made or written.
pub fn give(make: impl FnOnce() -> Vec<Vec<u8>>) {
    let Some(folder) = std::env::var_os("PUMICE_FUZZ_SEEDS").map(PathBuf::from) else { return };
    for (i, bytes) in make().into_iter().enumerate() {
        std::fs::write(folder.join(format!("seed-{i:02}")), bytes).unwrap();
    }
}

/// The bytes that `write` writes to a path with this extension.
fn written(extension: &str, write: impl FnOnce(&Path)) -> Vec<u8> {
    let path = scratch::path(extension);
    write(&path);
    let bytes = std::fs::read(&path).unwrap();
    std::fs::remove_file(&path).unwrap();
    bytes
}

/// Ids of balls in layers, which give boxes of every size, and full and mixed cells.
fn ids(dims: [u32; 3]) -> Vec<u32> {
    let mut ids = Vec::new();
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for x in 0..dims[0] {
                let far = (x % 10).pow(2) + (y % 12).pow(2) + (z % 9).pow(2) > 60;
                ids.push(if far { 0 } else { 1 + x / 10 + 3 * (y / 12) + u32::from(x == y) });
            }
        }
    }
    ids
}

fn info(dims: [u32; 3], label_type: LabelType) -> VolumeInfo {
    let mut info = VolumeInfo::new(dims, label_type);
    info.world_from_index = DAffine3::from_scale(DVec3::new(0.5, 0.25, 2.0))
        * DAffine3::from_translation(DVec3::new(1.0, -2.0, 3.0));
    info.notes = vec![LabelNote { id: 2, name: Some("axon".into()), color_srgb: Some([0.25, 0.5, 1.0]) }];
    info
}

fn volume(dims: [u32; 3]) -> CompressedVolume {
    compress_labels(info(dims, LabelType::U32), LabelBuffer::U32(ids(dims))).unwrap()
}

/// `.pumice` files with several boxes, several chunks, one voxel, and no labels, each at all levels.
pub fn pumice_files() -> Vec<Vec<u8>> {
    let empty = compress_labels(info([5, 1, 1], LabelType::U8), LabelBuffer::U8(vec![0; 5])).unwrap();
    let volumes = [volume([21, 13, 9]), volume([33, 17, 16]), volume([1, 1, 2060]), volume([1, 1, 1]), empty];
    let levels = [Level::Fast, Level::Default, Level::Small];
    let saved =
        |v: &CompressedVolume, level| written(".pumice", |path| v.save(path, level, &Job::new()).unwrap());
    volumes.iter().flat_map(|v| levels.map(|level| saved(v, level))).collect()
}

/// Tables of labels of every format.
pub fn label_tables() -> Vec<Vec<u8>> {
    let texts = |texts: [&str; 3]| texts.map(str::to_owned).to_vec();
    let columns = vec![NumericColumn { name: "depth".into(), values: vec![1.5, -2.0, 1e9] }];
    let colors = vec![Some([1.0, 0.5, 0.0]); 3];
    let (names, types) = (texts(["axon", "a \"b\", c", "x_1"]), texts(["glia", "", "axon"]));
    let table = AnnotationTable::new(vec![3, 17, u64::MAX], names, types, colors, columns).unwrap();
    let bytes = |format: LabelTableFormat| format.to_text(Path::new("table"), &table).unwrap().0.into_bytes();
    LabelTableFormat::ALL.map(bytes).into()
}

/// Volumes of every format that has a writer, and hand-written ones of the others.
pub fn label_volumes() -> Vec<Vec<u8>> {
    let dims = [6, 5, 4];
    let write = |extension: &str, label_type: LabelType| {
        let ids: Vec<u64> = ids(dims).into_iter().map(u64::from).collect();
        let volume = |path: &Path| {
            let slab = (dims[0] * dims[1]) as usize;
            let decode = |o: [u32; 3], d: [u32; 3]| {
                assert_eq!(o[..2], [0, 0]);
                Ok(ids[o[2] as usize * slab..][..slab * d[2] as usize].to_vec())
            };
            write_volume(path, &info(dims, label_type), &mut { decode }).unwrap();
        };
        written(extension, volume)
    };
    let mut seeds = Vec::new();
    for extension in [".nrrd", ".npy", ".nii", ".nii.gz", ".tif"] {
        for label_type in [LabelType::U8, LabelType::U16] {
            seeds.push(write(extension, label_type));
        }
    }

    let text: String = (0..24).map(|i| format!("{} ", i % 5)).collect();
    let nrrd = |fields: &str, data: &str| format!("NRRD0004\n{fields}\n\n{data}").into_bytes();
    seeds.push(nrrd("type: uchar\ndimension: 3\nsizes: 4 3 2\nencoding: ascii\nspacings: 1 1 2", &text));
    seeds.push(nrrd(
        "type: uint8\ndimension: 4\nsizes: 2 2 3 2\nkinds: list domain domain domain\nencoding: text",
        &text,
    ));
    seeds.push(nrrd(
        "type: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 2 2 1\nspace directions: (1,0,0) (0,1,0) (0,0,2)\n\
         space origin: (1,2,3)\nendian: big\nencoding: hex\nkinds: domain domain domain\nSegment0_ID:=a\nSegment0_Name:=b\n\
         Segment0_LabelValue:=1\nSegment0_Layer:=0\nSegment0_Color:=0.5 0.5 1",
        "0001 0002 0003 0000",
    ));
    let meta = |fields: &str, data: &str| {
        format!("ObjectType = Image\nNDims = 3\n{fields}\nElementDataFile = LOCAL\n{data}").into_bytes()
    };
    let place = "BinaryDataByteOrderMSB = False\nElementSpacing = 1 1 2\nOffset = 1 2 3\nTransformMatrix = 1 0 0 0 1 0 0 0 1";
    seeds.push(meta(
        &format!("BinaryData = True\n{place}\nDimSize = 4 3 2\nElementType = MET_UCHAR"),
        &text[..24],
    ));
    seeds.push(meta("BinaryData = False\nDimSize = 4 3 2\nElementType = MET_USHORT", &text));
    let npy = write(".npy", LabelType::U16);
    seeds.push(stored_zip("labels.npy", &npy));
    seeds
}

/// A ZIP archive with one member that is not compressed (APPNOTE.TXT 4.3).
fn stored_zip(name: &str, bytes: &[u8]) -> Vec<u8> {
    // The fields from "version needed" to "extra length" are the same in the local header and the directory.
    let mut facts = vec![20, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    facts.extend(crc32fast::hash(bytes).to_le_bytes());
    facts.extend((bytes.len() as u32).to_le_bytes());
    facts.extend((bytes.len() as u32).to_le_bytes());
    facts.extend((name.len() as u16).to_le_bytes());
    facts.extend([0, 0]);
    let mut zip = [b"PK\x03\x04", &facts[..], name.as_bytes(), bytes].concat();
    let directory = [b"PK\x01\x02\x14\0", &facts[..], &[0; 14], name.as_bytes()].concat();
    let (at, length) = (zip.len() as u32, directory.len() as u32);
    zip.extend(directory);
    zip.extend(b"PK\x05\x06\0\0\0\0\x01\0\x01\0");
    zip.extend(length.to_le_bytes());
    zip.extend(at.to_le_bytes());
    zip.extend([0, 0]);
    zip
}

/// Inputs of the target `raw_volume`: a layout, then voxels.
pub fn raw_volumes() -> Vec<Vec<u8>> {
    let layout = |dims: [u32; 3], label_type: u8, big_endian: u8, offset: u16| {
        let mut seed: Vec<u8> = dims.iter().flat_map(|d| d.to_le_bytes()).collect();
        seed.extend([label_type, big_endian]);
        seed.extend(offset.to_le_bytes());
        seed
    };
    let plain = [&layout([4, 3, 2], 0, 0, 0)[..], &[7; 24]].concat();
    let wide = [&layout([2, 2, 1], 3, 1, 3)[..], &[0; 35]].concat();
    let float = [&layout([2, 1, 1], 8, 0, 0)[..], &1f32.to_le_bytes(), &2f32.to_le_bytes()].concat();
    vec![plain, wide, float]
}

/// A scene of few fields.
pub const SCENE: &str = r#"{
  "version": 1,
  "instances": [{
    "id": 7, "source": "a.pumice", "world_from_index": [1, 0, 0, 0, 0.1, 0, 0, 0, 1e-9, -4, 5, 6],
    "style": { "show": { "only": [1, 18446744073709551615] }, "auto_color": true }
  }],
  "camera": {
    "world_from_camera": [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 10],
    "projection": { "perspective": { "fov_rad": 0.7 } }
  },
  "film": { "width": 5, "height": 4, "filter": { "blackman_harris": { "width": 3.0 } } },
  "world": { "environment": { "constant": { "radiance": [0.1, 0.2, 0.3] } } },
  "settings": { "seed": 1 }
}"#;

/// Scenes, the second with all fields written out.
pub fn scenes() -> Vec<Vec<u8>> {
    let whole = Scene::from_json(SCENE).unwrap().to_json().unwrap();
    vec![SCENE.into(), whole.into()]
}

/// States of Neuroglancer: as it writes them today, as it wrote them before 2019, and as a link.
pub fn neuroglancer_states() -> Vec<Vec<u8>> {
    let today = r##"{"dimensions": {"x": [8e-9, "m"], "y": [8, "nm"], "z": [33e-9, "m"], "t": [1, "s"]},
        "relativeDisplayScales": {"z": 2}, "displayDimensions": ["x", "y", "z"], "position": [1, 1.5, 0.5, 0],
        "projectionOrientation": [0.1, 0.7, -0.2, 0.6], "projectionScale": 3.5, "projectionBackgroundColor": "#123",
        "layout": {"type": "3d", "orthographicProjection": true},
        "layers": [
            {"type": "segmentation", "name": "a", "source": {"url": "precomputed://gs://b/a"}, "segments": ["1", "!2", 3],
             "segmentColors": {"1": "#ff8000", "3": "hsl(120, 50%, 50%)"}, "segmentDefaultColor": "red", "colorSeed": 77,
             "saturation": 0.5, "objectAlpha": 0.25, "equivalences": [["1", "4"], ["3", 5]]},
            {"type": "segmentation", "name": "b", "source": ["zarr://s3://b/z"], "linkedSegmentationGroup": "a"},
            {"type": "image", "name": "em", "source": "n5://https://host/em", "visible": false}]}"##;
    let before = r#"{"navigation": {"pose": {"position": {"voxelSize": [4, 4, 40], "voxelCoordinates": [1, 1, 1]}}},
        "perspectiveOrientation": [0, 0, 1, 0], "perspectiveZoom": 64, "perspectiveViewBackgroundColor": "white",
        "layers": {"a": {"type": "segmentation", "source": "file:///v", "segments": ["7"], "archived": false}}}"#;
    let link = r##"https://host/#!%7B%22layers%22:%5B{"type":"segmentation","name":"a","source":"zarr://v","segments":["2"]}%5D%7D"##;
    [today, before, link].map(|text| text.as_bytes().to_vec()).into()
}

/// Pictures: EXR and PNG by Pumice, and EXR with the compressions that other programs use.
pub fn pictures() -> Vec<Vec<u8>> {
    use exr::prelude::{Compression, Encoding, SpecificChannels, WritableImage};
    let (width, height) = (5, 4);
    let image = Image::new(width, height, (0..20).map(|i| [i as f32, 0.5, 1.0 / (1.0 + i as f32)]).collect());
    let ours = Picture {
        color: image.clone(),
        noisy: Some(image.clone()),
        variance: Some(image.clone()),
        depth: Some(vec![f32::INFINITY; 20]),
        label: Some((0..20).collect()),
        instance: Some(vec![1; 20]),
        labels: vec![pumice_picture::InstanceLabels {
            instance: 1,
            rows: (1..20).collect(),
            ids: (101..120).collect(),
            ..pumice_picture::InstanceLabels::default()
        }],
        albedo: Some(image.clone()),
        normal: Some(image.clone()),
        alpha: Some(vec![0.5; 20]),
        position: Some(image.clone()),
        samples: Some(vec![64.0; 20]),
        light: Pass::LIGHT.iter().map(|pass| (*pass, image.clone())).collect(),
        mattes: vec![pumice_picture::Matte {
            pass: Pass::CryptomatteLabel,
            layers: vec![vec![[1.5, 0.75, -2.5, 0.25]; 20]],
            names: [("17".to_owned(), 0x3fc0_0000)].into(),
        }],
        provenance: Some(Provenance {
            version: "0.1.0".into(),
            backend: "cpu".into(),
            scene: Scene::from_json(SCENE).unwrap(),
            volume_hashes: vec!["0123456789abcdef0123456789abcdef".into()],
            label_hashes: Vec::new(),
            mesh_hashes: Vec::new(),
            sky_hash: None,
            spp: 64,
            error_estimate: Some(0.01),
            denoised: None,
            annotations: pumice_picture::Annotations { dpi: Some(300.0), ..Default::default() },
        }),
        marks: Vec::new(),
        dpi: Some(300.0),
    };
    let mut seeds = vec![
        written(".exr", |path| write_exr(path, &ours, &Passes::ALL).unwrap()),
        written(".png", |path| write_png(path, &ours).unwrap()),
    ];
    let tiled = Encoding::FAST_LOSSLESS;
    let packed = |compression| Encoding { compression, ..Encoding::UNCOMPRESSED };
    let codecs =
        [Compression::RLE, Compression::ZIP1, Compression::ZIP16, Compression::PIZ, Compression::PXR24];
    let lossy = [Compression::B44, Compression::B44A];
    for encoding in codecs.into_iter().chain(lossy).map(packed).chain([tiled, Encoding::UNCOMPRESSED]) {
        let pixel = |p: exr::prelude::Vec2<usize>| (p.x() as f32, p.y() as f32, 0.5f32);
        let layer = exr::prelude::Layer::new(
            (width, height),
            exr::prelude::LayerAttributes::default(),
            encoding,
            SpecificChannels::rgb(pixel),
        );
        let image = exr::prelude::Image::from_layer(layer);
        seeds.push(written(".exr", |path| image.write().to_file(path).unwrap()));
    }
    seeds
}

/// HDF5 files of a few kB: without chunks, and with chunks under each filter, of the first and of the newest version of the format.
pub fn hdf5_files() -> Vec<Vec<u8>> {
    [
        include_bytes!("../seeds/plain.h5").as_slice(),
        include_bytes!("../seeds/gzip.h5"),
        include_bytes!("../seeds/lzf.h5"),
        include_bytes!("../seeds/latest.h5"),
        include_bytes!("../seeds/scaleoffset.h5"),
        include_bytes!("../seeds/groups.h5"),
    ]
    .map(<[u8]>::to_vec)
    .into()
}

/// Tables of pairs of ids: text with each delimiter, and an array.
pub fn relabel_tables() -> Vec<Vec<u8>> {
    let header = "{'descr': '<u8', 'fortran_order': False, 'shape': (2, 2), }";
    let head = format!("{header:117}\n");
    let pairs: Vec<u8> = [1u64, 7, 2, 7].iter().flat_map(|id| id.to_le_bytes()).collect();
    vec![
        b"supervoxel,segment\n1,7\n2,7\n".to_vec(),
        b"# pairs\n1\t18446744073709551615\n3;0\n4 5\n".to_vec(),
        [b"\x93NUMPY\x01\0v\0".as_slice(), head.as_bytes(), &pairs].concat(),
    ]
}
