//! Compares the shaders' light transport with the CPU's: single samples, films, first surfaces.

#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used, reason = "tests")]

#[path = "../../cpu-renderer/tests/exact/mod.rs"]
mod exact;
mod gpu;
#[path = "../../cpu-renderer/tests/meshes/shapes.rs"]
#[expect(dead_code, reason = "made for another test too")]
mod shapes;

#[path = "radiance/catchers.rs"]
mod catchers;
#[path = "radiance/controls.rs"]
mod controls;
#[path = "radiance/device.rs"]
mod device;
#[path = "radiance/films.rs"]
mod films;
#[path = "radiance/samples.rs"]
mod samples;
#[path = "radiance/scenes.rs"]
mod scenes;

use std::sync::Mutex;

use device::Front;
use gpu::Shared;
use gpu::turns::some_of_today;
use samples::{Verdict, asked, found};
use scenes::cases;

static PATHS: Mutex<Option<Vec<Front>>> = Mutex::new(None);

/// The integrator on the backends of the day, compiled once for all tests of films.
fn paths() -> Shared<Vec<Front>> {
    Shared::take(&PATHS, || Front::of_today("path"), |fronts| fronts.iter().map(|front| &front.gpu).collect())
}

/// Samples a pixel of each scene, as many as one launch adds. The [negative controls](controls) have as many.
const SPP: u32 = 8;

/// Half of the scenes a day, with native doubles, where the device has them. Emulated doubles are tested in single functions, and take far
/// longer to compile.
#[test]
fn samples_are_the_cpus() {
    let fronts = paths();
    let compute = fronts.last().expect("compute");
    for case in some_of_today(&cases(), 2) {
        let asked = asked(&case, SPP);
        let found = found(&case, &asked);
        let rays: f64 = found.iter().map(|f| f64::from(f.rays)).sum::<f64>() / found.len() as f64;
        let verdict = Verdict::of(&case, &found, &compute.radiances(&case, SPP));
        println!("{}: {rays:.2} rays a sample; {verdict}", case.name);
        assert_eq!(verdict.fault(), None, "{}", case.name);
        // A test in which rays meet nothing would prove nothing, nor would one whose bound accepts everything. (A room of 32 bounces has 11
        // rays a sample that may part.)
        assert!(rays > 0.3 && verdict.most_parted < 0.07 * asked.len() as f64, "{}", case.name);
    }
}
