//! Negative controls: the formulations that most voxel tracers use, in f32, checked with the same oracle. If it accepted them, the
//! exactness tests would prove nothing.

#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

mod exact;

use exact::rays::{Class, ray};
use exact::volumes::{Random, noise};
use exact::{Dense, ExactRay, Verdict, judge};
use glam::DVec3;
use pumice_transport::{Hit, Surface, SurfaceKind};

fn hit_at(volume: &Dense, v: [i64; 3], t: f64, axis: usize, d: [f64; 3]) -> Hit {
    let positive = d[axis] < 0.0;
    Hit {
        t,
        surface: Surface {
            instance: 0,
            kind: SurfaceKind::Face,
            voxel: v.map(|x| x as u32),
            axis: axis as u8,
            positive,
            plane: (v[axis] + i64::from(positive)) as u32,
            label: volume.at(v).wrapping_sub(1),
        },
        normal_in_world: DVec3::ZERO,
        from_inside: false,
    }
}

/// Advances a point from plane to plane, plus an epsilon to get across.
fn epsilon_advance(volume: &Dense, o: [f64; 3], d: [f64; 3], epsilon: f32) -> Option<Hit> {
    let (o, df) = (o.map(|x| x as f32), d.map(|x| x as f32));
    let mut t = 0.0f32;
    for a in (0..3).filter(|&a| d[a] != 0.0) {
        let near = if d[a] < 0.0 { volume.dims[a] as f32 } else { 0.0 };
        t = t.max((near - o[a]) / df[a]);
    }
    for _ in 0..2000 {
        let p = [0, 1, 2].map(|a| o[a] + (t + epsilon) * df[a]);
        let v = p.map(|x| x.floor() as i64);
        if (0..3).any(|a| v[a] < 0 || v[a] >= i64::from(volume.dims[a])) {
            return None;
        }
        if volume.at(v) != 0 {
            let near = |a: usize| (v[a] as f32 + f32::from(u8::from(df[a] < 0.0)) - o[a]) / df[a];
            let axis = (0..3).filter(|&a| d[a] != 0.0).max_by(|&a, &b| near(a).total_cmp(&near(b)))?;
            let plane = v[axis] as f64 + f64::from(u8::from(d[axis] < 0.0));
            return Some(hit_at(volume, v, (plane - f64::from(o[axis])) / d[axis], axis, d));
        }
        t = (0..3)
            .filter(|&a| d[a] != 0.0)
            .map(|a| (v[a] as f32 + f32::from(u8::from(df[a] > 0.0)) - o[a]) / df[a])
            .fold(f32::INFINITY, f32::min);
    }
    None
}

/// Amanatides and Woo 1987, in f32: the voxel of the start, then tmax += tdelta.
fn amanatides_woo(volume: &Dense, o: [f64; 3], d: [f64; 3]) -> Option<Hit> {
    let (of, df) = (o.map(|x| x as f32), d.map(|x| x as f32));
    let mut enter = 0.0f32;
    let mut axis = 0;
    for a in (0..3).filter(|&a| d[a] != 0.0) {
        let near = ((if d[a] < 0.0 { volume.dims[a] as f32 } else { 0.0 }) - of[a]) / df[a];
        if near > enter {
            (enter, axis) = (near, a);
        }
    }
    let mut v = [0, 1, 2].map(|a| (of[a] + enter * df[a]).floor() as i64);
    let mut t = [0, 1, 2].map(|a| (v[a] as f32 + f32::from(u8::from(df[a] > 0.0)) - of[a]) / df[a]);
    loop {
        if (0..3).any(|a| v[a] < 0 || v[a] >= i64::from(volume.dims[a])) {
            return None;
        }
        if volume.at(v) != 0 {
            let plane = v[axis] as f64 + f64::from(u8::from(d[axis] < 0.0));
            return Some(hit_at(volume, v, (plane - o[axis]) / d[axis], axis, d));
        }
        axis = (0..3).filter(|&a| d[a] != 0.0).min_by(|&a, &b| t[a].total_cmp(&t[b]))?;
        v[axis] += d[axis].signum() as i64;
        t[axis] += (1.0 / df[axis]).abs();
    }
}

fn wrong_share(class: Class, trace: impl Fn(&Dense, [f64; 3], [f64; 3]) -> Option<Hit>) -> f64 {
    let (dense, _) = noise([64, 64, 64], 0.03, 4, 2);
    let mut random = Random(17);
    let n = 3000;
    let wrong = (0..n)
        .filter(|_| {
            let (o, d) = ray(class, dense.dims, 20, &mut random);
            let hit = trace(&dense, o, d);
            matches!(judge(&dense, &ExactRay::new(o, d), hit.as_ref()), Verdict::Wrong(_))
        })
        .count();
    let share = wrong as f64 / f64::from(n);
    println!("{class:?}: {:.1} % wrong", 100.0 * share);
    share
}

#[test]
fn an_epsilon_advance_in_f32_is_convicted() {
    let trace = |v: &Dense, o, d| epsilon_advance(v, o, d, 1e-4);
    assert!(wrong_share(Class::Far1e6, trace) > 0.2);
    assert!(wrong_share(Class::Far1e9, trace) > 0.2);
}

#[test]
fn amanatides_and_woo_in_f32_are_convicted() {
    assert!(wrong_share(Class::Far1e6, amanatides_woo) > 0.02);
    assert!(wrong_share(Class::Far1e9, amanatides_woo) > 0.2);
    assert!(wrong_share(Class::Grazing, amanatides_woo) > 0.02);
}
