//! How many operations on doubles a ray through bricks takes, where floats are compared first and where they are not.

use glam::DAffine3;
use pumice_oracle::Dense;
use pumice_scene::PartSet;
use pumice_transport::geometry::LodChoice;
use pumice_vulkan::device::Backend;
use pumice_vulkan::pack::{FLOATS_FIRST, ShaderNeeds};

use super::exact::cases::volumes;
use super::exact::rays::Class;
use super::exact::volumes::Random;
use super::gpu::scene::Form;
use super::{Asked, DOUBLES, FLOATS, Front, Numbers, bounces, instance, rays_of, tracer};

impl Front {
    /// A front that counts, for scenes of bricks alone.
    fn that_counts(backend: Backend, numbers: Numbers) -> Self {
        let needs = ShaderNeeds {
            parts: PartSet::NONE,
            instance_tree: false,
            bricks: true,
            boxes: false,
            pages: false,
        };
        let mut constants = needs.constants().to_vec();
        assert_eq!(constants.len(), FLOATS_FIRST);
        constants.push(u32::from(numbers.floats_first));
        Self::of("count_doubles", backend, numbers, &constants)
    }
}

/// Floats decide nearly all steps. What remains is what a ray needs to begin and to end, and a query to clip each brick that its hierarchy finds:
/// a third of the operations in a compute shader, half in a query. A hierarchy of another driver may find more bricks, hence two thirds.
#[test]
fn floats_spare_doubles() {
    for backend in super::gpu::backends() {
        // (A pipeline's walk is in a program of its own, whose counts do not reach the record.)
        if backend == Backend::RayPipeline {
            continue;
        }
        let fronts = [DOUBLES, FLOATS].map(|numbers| Front::that_counts(backend, numbers));
        let mut sums = [0.0; 2];
        for (name, Dense { dims, .. }, volume) in volumes() {
            let traced = [instance(&volume, DAffine3::IDENTITY, LodChoice::Voxels)];
            let first = rays_of(Class::Random, dims, 20, &DAffine3::IDENTITY, 2_000);
            let second = bounces(&tracer(&traced, &[], Form::Bricks), &first, &mut Random(31));
            for (what, asked) in [("first", first), ("bounced", second)] {
                let counts = fronts.each_ref().map(|f| f.mean_count(&traced, &asked));
                let [without, with] = counts;
                println!(
                    "{backend}, {name}, {what}: {without:.0} operations on doubles a ray, {with:.0} with floats first"
                );
                assert!(0.0 < with && with < without, "{backend}, {name}, {what}: {without}, {with}");
                sums = [sums[0] + without, sums[1] + with];
            }
        }
        assert!(sums[1] < sums[0] * 2.0 / 3.0, "{backend}: {sums:?}");
    }
}

impl Front {
    /// Mean number of operations on doubles a ray.
    fn mean_count(&self, traced: &[super::TracedInstance], asked: &[Asked]) -> f64 {
        let counts = self.trace(Form::Bricks, traced, &[], &[], asked);
        counts.iter().map(|r| f64::from(r.reserved)).sum::<f64>() / counts.len() as f64
    }
}
