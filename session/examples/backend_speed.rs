//! How fast each backend is on one volume: rays per second, and seconds a frame for each level of detail.
//!
//! `backend_speed VOLUME WIDTHxHEIGHT BACKEND[,BACKEND…] [LABELS]` draws the figure of LABELS long labels (all of them when 0; 96
//! unless told). Rays: a picture of black labels costs primary rays alone, one of grey labels without light a second, diffuse ray
//! from each hit; what the second costs is the difference. Frames: one sample a pixel under the figure's own light, at 1 and 32
//! bounces. Wall seconds, the least of several frames after one that is not counted; CPU seconds of the process beside them.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use pumice_core::CompressedVolume;
use pumice_scene::{Environment, LabelMaterials, Lod, Material, Scene, Show};
use pumice_session::figure::{FigureOptions, compose};
use pumice_session::selection::select_labels;
use pumice_session::{Job, OpenOptions, Residence, Stopwatch, make_renderer, open_volume};
use pumice_transport::Renderer;

/// Frames of which the fastest counts: so few that the error, which costs time, is not estimated yet.
const FRAMES: usize = 2;

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().collect();
    let (path, size, backends, count) = match arguments.as_slice() {
        [_, path, size, backends] => (PathBuf::from(path), size, backends, 96),
        [_, path, size, backends, count] => (PathBuf::from(path), size, backends, count.parse()?),
        _ => return Err("usage: backend_speed VOLUME WIDTHxHEIGHT BACKEND[,BACKEND...] [LABELS]".into()),
    };
    let (width, height) = size.split_once('x').ok_or("a size such as 1920x1080")?;
    let size = [width.parse()?, height.parse()?];
    let volume = open_volume(&path, &OpenOptions::default(), Residence::Copied, &Job::new())?;
    let labels = (count > 0).then(|| select_labels(&volume, count));
    let options = FigureOptions { size, labels, view_deg: FigureOptions::DEFAULT_VIEW_DEG };
    let scene = compose(&volume, path, &options);
    let boxes: usize = match &scene.instances[0].style.show {
        Show::Only(ids) => ids.len(),
        _ => volume.labels().len(),
    };
    println!("{boxes} labels shown, {} by {} pixels", size[0], size[1]);
    for backend in backends.split(',') {
        measure(backend, &scene, &volume)?;
    }
    Ok(())
}

fn measure(backend: &str, scene: &Scene, volume: &Arc<CompressedVolume>) -> Result<(), Failure> {
    let mut renderer = make_renderer(backend)?;
    let pixels = f64::from(scene.film.width) * f64::from(scene.film.height);
    let dark = |base_color: f32| {
        let mut dark = scene.clone();
        let style = &mut dark.instances[0].style;
        style.auto_color = false;
        style.materials = LabelMaterials::default();
        style.material = Material {
            base_color: [base_color; 3],
            specular: 0.0,
            metallic: 0.0,
            roughness: 1.0,
            ..Material::default()
        };
        dark.suns.clear();
        dark.world.environment = Environment::Constant { radiance: [0.0; 3] };
        dark.settings.bounces = 0;
        dark
    };
    let primary = frame(&mut renderer, &dark(0.0), volume)?;
    let both = frame(&mut renderer, &dark(0.8), volume)?;
    let hits = renderer.picture()?.label.iter().flatten().filter(|&&l| l != 0).count() as f64;
    println!("{backend}: on {}", renderer.device());
    println!(
        "{backend}: primary {:.3} M/s, {:.3} M/CPU-s",
        pixels / primary.0 / 1e6,
        pixels / primary.1 / 1e6
    );
    let (wall, cpu) = (both.0 - primary.0, both.1 - primary.1);
    println!("{backend}: bounce {:.3} M/s, {:.3} M/CPU-s", hits / wall / 1e6, hits / cpu / 1e6);
    for (name, lod) in
        [("finest", Lod::Voxels), ("by distance", Lod::Distance { pixels: 1.0 }), ("coarsest", Lod::Boxes)]
    {
        for bounces in [1, 32] {
            let mut lit = scene.clone();
            lit.settings.lod = lod;
            lit.settings.bounces = bounces;
            let (wall, cpu) = frame(&mut renderer, &lit, volume)?;
            println!("{backend}: frame {name}, {bounces} bounces {:.4} s, {cpu:.4} CPU-s", wall);
        }
    }
    renderer.set_scene(scene, std::slice::from_ref(volume), &[])?;
    for (part, bytes) in renderer.bytes() {
        println!("{backend}: {part} {bytes} bytes");
    }
    for notice in renderer.notices() {
        println!("{backend}: {notice}");
    }
    Ok(())
}

/// Wall and CPU seconds of one sample a pixel.
fn frame(
    renderer: &mut dyn Renderer,
    scene: &Scene,
    volume: &Arc<CompressedVolume>,
) -> Result<(f64, f64), Failure> {
    renderer.set_scene(scene, std::slice::from_ref(volume), &[])?;
    let mut best = (f64::INFINITY, f64::INFINITY);
    for number in 0..=FRAMES {
        let clock = Stopwatch::start();
        renderer.advance(Duration::ZERO, number as u32 + 1, &Job::new())?;
        if number > 0 {
            best = (best.0.min(clock.seconds()), best.1.min(clock.cpu_seconds()));
        }
    }
    Ok(best)
}
