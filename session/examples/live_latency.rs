//! How long a live picture takes to follow an edit, and what it costs the one who edits.
//!
//! `live_latency VOLUME WIDTHxHEIGHT [LABEL_COLOURS]`: opens a volume (32 long labels, or with LABEL_COLOURS all of them, each with a
//! material of its own), waits for the first picture, then moves the camera and edits a colour 20 times each. Prints medians and
//! worst cases in milliseconds of wall time: what a person at the screen waits for.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use pumice_scene::{Material, SceneEdit};
use pumice_session::figure::{FigureOptions, compose};
use pumice_session::live::{Frame, Live, LiveOptions};
use pumice_session::selection::select_labels;
use pumice_session::{Job, OpenOptions, Residence, open_volume};

const ROUNDS: usize = 20;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let (path, size, colors) = match arguments.as_slice() {
        [_, path, size] => (PathBuf::from(path), size, false),
        [_, path, size, _] => (PathBuf::from(path), size, true),
        _ => return Err("usage: live_latency VOLUME WIDTHxHEIGHT [LABEL_COLOURS]".into()),
    };
    let (width, height) = size.split_once('x').ok_or("a size such as 1920x1080")?;
    let size = [width.parse()?, height.parse()?];
    let volume = open_volume(&path, &OpenOptions::default(), Residence::Copied, &Job::new())?;
    let labels = (!colors).then(|| select_labels(&volume, 32));
    let options = FigureOptions { size, labels, view_deg: FigureOptions::DEFAULT_VIEW_DEG };
    let mut scene = compose(&volume, path, &options);
    if colors {
        let of = |id: &u64| (*id, Material { base_color: [0.25, 0.5, 0.75], ..Material::default() });
        scene.instances[0].style.materials = volume.labels().ids().iter().map(of).collect();
    }
    println!("{} labels with a material of their own", scene.instances[0].style.materials.len());
    let id = volume.labels().ids()[0];
    let camera = scene.camera;

    let begin = Instant::now();
    let live = Live::start(scene, vec![Arc::clone(&volume)], vec![], LiveOptions::default())?;
    let mut serial = wait(&live, 0, |_| true).serial;
    println!("first frame {:.1} ms after the start", milliseconds(begin.elapsed()));
    wait(&live, serial, |f| !f.coarse);

    for (name, edit) in [
        (
            "camera",
            &(|i: usize| {
                let mut camera = camera;
                camera.shift[0] += 1e-3 * i as f64;
                SceneEdit::Camera { camera }
            }) as &dyn Fn(usize) -> SceneEdit,
        ),
        ("colour", &|i| {
            let material =
                Material { base_color: [i as f32 / ROUNDS as f32, 0.5, 0.5], ..Material::default() };
            SceneEdit::LabelMaterials { id: 1, materials: [(id, Some(material))].into() }
        }),
    ] {
        let (mut calls, mut firsts, mut wholes) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..ROUNDS {
            let begin = Instant::now();
            let revision = live.edit(vec![edit(i)])?;
            calls.push(begin.elapsed());
            let first = wait(&live, serial, |f| f.revision == revision);
            firsts.push(begin.elapsed());
            serial = wait(&live, first.serial - 1, |f| f.revision == revision && !f.coarse).serial;
            wholes.push(begin.elapsed());
        }
        println!("{name}: call {}", spread(&mut calls));
        println!("{name}: first frame {}", spread(&mut firsts));
        println!("{name}: whole frame {}", spread(&mut wholes));
    }
    let mut takes = Vec::new();
    for _ in 0..1000 {
        let begin = Instant::now();
        std::hint::black_box(live.latest(0));
        takes.push(begin.elapsed());
    }
    println!("latest: call {}", spread(&mut takes));
    Ok(())
}

fn wait(live: &Live, after: u64, wanted: impl Fn(&Frame) -> bool) -> Arc<Frame> {
    loop {
        match live.latest(after) {
            Some(frame) if wanted(&frame) => return frame,
            _ => std::thread::sleep(Duration::from_micros(200)),
        }
    }
}

fn milliseconds(d: Duration) -> f64 {
    d.as_secs_f64() * 1e3
}

/// Median and worst.
fn spread(durations: &mut [Duration]) -> String {
    durations.sort();
    let (median, worst) = (durations[durations.len() / 2], durations[durations.len() - 1]);
    format!("median {:.3} ms worst {:.3} ms", milliseconds(median), milliseconds(worst))
}
