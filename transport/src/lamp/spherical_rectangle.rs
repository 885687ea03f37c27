//! Uniform directions over a rectangle: Ureña, Fajardo and King 2013, "An area-preserving parametrization for spherical
//! rectangles", §3.
//!
//! The paper sums four angles, of which it has the cosines, and subtracts 2π; for a small rectangle nothing of that remains in f32. Here
//! each angle is π/2 minus an arcsine, so that the π/2 cancel before anything is rounded. Compared with the paper this adds half a turn to
//! φ: its sine and cosine change signs, and with them one of the two `b`.

use glam::Vec2;

/// A rectangle as seen from the origin of its own frame: from corner `lo` to corner `hi` in a plane `height` away.
#[derive(Clone, Copy, Debug)]
pub struct SphericalRectangle {
    lo: Vec2,
    hi: Vec2,
    height: f32,
    /// Cosines, with the plane's normal, of the planes through the origin and the lower side, and the upper side.
    b: [f32; 2],
    /// Sum of the arcsines of the two left-hand corners, where φ starts.
    start: f32,
    /// Solid angle of the rectangle.
    pub solid_angle: f32,
}

/// Arcsine computed from the arctangent, which the graphics processor has exactly.
#[inline]
fn arcsine(x: f32) -> f32 {
    let x = x.clamp(-1.0, 1.0);
    x.atan2(((1.0 - x) * (1.0 + x)).sqrt())
}

impl SphericalRectangle {
    /// The rectangle between two corners in the plane at distance `height`, which is above 0.
    #[inline]
    pub fn new(lo: Vec2, hi: Vec2, height: f32) -> Self {
        let h2 = height * height;
        let below = -lo.y / (lo.y * lo.y + h2).sqrt();
        let right = hi.x / (hi.x * hi.x + h2).sqrt();
        let above = hi.y / (hi.y * hi.y + h2).sqrt();
        let left = -lo.x / (lo.x * lo.x + h2).sqrt();
        let start = -(arcsine(above * left) + arcsine(left * below));
        let solid_angle = arcsine(below * right) + arcsine(right * above) - start;
        Self { lo, hi, height, b: [below, above], start, solid_angle }
    }

    /// Maps two random numbers to a point of the rectangle, as its x and y.
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> Vec2 {
        // x, by the solid angle to its left.
        let (sin, cos) = (u[0] * self.solid_angle + self.start).sin_cos();
        let mut x = 0.0;
        if sin != 0.0 {
            let f = (cos * self.b[0] + self.b[1]) / sin;
            let c = (1.0 / (f * f + self.b[0] * self.b[0]).sqrt()).min(1.0).copysign(f);
            x = c * self.height / ((1.0 - c) * (1.0 + c)).sqrt().max(1e-7);
        }
        let x = x.clamp(self.lo.x, self.hi.x);
        // y, by the sines of the angles to both sides.
        let d2 = x * x + self.height * self.height;
        let low = self.lo.y / (d2 + self.lo.y * self.lo.y).sqrt();
        let high = self.hi.y / (d2 + self.hi.y * self.hi.y).sqrt();
        let s = low + u[1] * (high - low);
        let y = s * (d2 / ((1.0 - s) * (1.0 + s)).max(1e-12)).sqrt();
        Vec2::new(x, y.clamp(self.lo.y, self.hi.y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Solid angle in f64 by Van Oosterom and Strackee 1983: two triangles.
    fn exact(lo: Vec2, hi: Vec2, height: f32) -> f64 {
        let corner = |x: f32, y: f32| glam::DVec3::new(x.into(), y.into(), height.into()).normalize();
        let [a, b, c, d] = [corner(lo.x, lo.y), corner(hi.x, lo.y), corner(hi.x, hi.y), corner(lo.x, hi.y)];
        let triangle = |a: glam::DVec3, b: glam::DVec3, c: glam::DVec3| {
            2.0 * a.dot(b.cross(c)).abs().atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
        };
        triangle(a, b, c) + triangle(a, c, d)
    }

    const CASES: [([f32; 2], [f32; 2], f32); 6] = [
        ([-1.0, -1.0], [1.0, 1.0], 1.0),
        ([-0.5, -2.0], [3.0, -1.0], 0.2),
        ([2.0, 3.0], [4.0, 3.5], 1.0),
        ([-0.1, -0.1], [0.1, 0.1], 1.0),
        ([-1e6, -1e6], [1e6, 1e6], 1.0),
        ([-1.0, 5.0], [1.0, 6.0], 0.05),
    ];

    /// The bound: four arctangents of numbers up to π, with 8 roundings of 2⁻²⁴ each. In addition each arcsine's argument is off by three
    /// roundings, which its slope magnifies near 1; and a side more than 2¹² heights away cannot be told from one infinitely far away,
    /// which loses h/|x| + h/|y| of a corner.
    #[test]
    fn solid_angles_are_exact() {
        for (lo, hi, height) in CASES {
            let (lo, hi) = (Vec2::from_array(lo), Vec2::from_array(hi));
            let (got, expected) =
                (f64::from(SphericalRectangle::new(lo, hi, height).solid_angle), exact(lo, hi, height));
            let sine = |side: f32| f64::from(side) / f64::from(side).hypot(height.into());
            let lost = |x: f32, y: f32| {
                let flat = |side: f32| f64::from(height) / f64::from(side.abs());
                match x.abs().max(y.abs()) > 4096.0 * height {
                    true => flat(x) + flat(y),
                    false => 3.0 * 2f64.powi(-24) / (1.0 - (sine(x) * sine(y)).powi(2)).sqrt(),
                }
            };
            let corners = [(lo.x, lo.y), (hi.x, lo.y), (hi.x, hi.y), (lo.x, hi.y)];
            let limit = 2e-6 + corners.map(|(x, y)| lost(x, y)).iter().sum::<f64>();
            assert!((got - expected).abs() < limit, "{lo} {hi} {height}: {got}, {expected}");
        }
    }

    /// The rectangle up to a sampled point has that share of the solid angle: at full height for the first number, and within the column
    /// for the second. The negative control uses the rectangle's area instead.
    #[test]
    fn samples_share_the_solid_angle() {
        let mut convicted = 0;
        for (lo, hi, height) in CASES {
            let (lo, hi) = (Vec2::from_array(lo), Vec2::from_array(hi));
            let rectangle = SphericalRectangle::new(lo, hi, height);
            let whole = exact(lo, hi, height);
            for i in 1..8 {
                let u = i as f32 / 8.0;
                let x = rectangle.sample([u, 0.5]).x;
                let share = exact(lo, Vec2::new(x, hi.y), height) / whole;
                // The sine of φ loses the digits that f32 has beyond S: 2e-6 of up to 2π, over the solid angle.
                let limit = 1e-5 + 4e-6 / whole;
                assert!((share - f64::from(u)).abs() < limit, "{lo} {hi} {height}: {share} for {u}");
                let by_area = exact(lo, Vec2::new(lo.x + u * (hi.x - lo.x), hi.y), height) / whole;
                convicted += usize::from((by_area - f64::from(u)).abs() > limit);
                let y = rectangle.sample([u, u]).y;
                // A very narrow column.
                let half = 1e-3 * (x.abs() + 1.0);
                let (l, r) = (Vec2::new(x - half, lo.y), x + half);
                let column = exact(l, Vec2::new(r, y), height) / exact(l, Vec2::new(r, hi.y), height);
                assert!((column - f64::from(u)).abs() < 2e-2, "{lo} {hi} {height}: {column} for {u}");
            }
        }
        assert!(convicted > 20, "{convicted}");
    }
}
