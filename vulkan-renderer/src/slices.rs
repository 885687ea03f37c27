//! Divides a pass over the film into launches that are short enough for the screen to stay responsive.
//!
//! A long launch blocks the whole screen, and after a second or two the operating system resets the device. Each launch is timed, and the
//! next is made as large as fits [`AIM_SECONDS`], at most four times as large as the last: a launch of sky may be followed by one of glass,
//! which costs more a sample.
//!
//! ```text
//! film    ┌──────────────────┐   bands of 8 rows (a group's height); a launch takes whole bands,
//!         │1111111111111111111│   or a part of one where even a band is too much
//!         │222223333344444...│
//! ```

use crate::layout::Launch;

/// Target duration of a launch: half of the tenth of a second that is allowed, since the next one may cost more than predicted.
const AIM_SECONDS: f64 = 0.05;

/// Longest allowed duration of a launch.
pub(crate) const MOST_SECONDS: f64 = 0.1;

/// Rows of a band.
pub(crate) const BAND: u32 = 8;

/// Samples of the first launch on an unknown device: some milliseconds on the slowest known device.
const FIRST_SAMPLES: f64 = 256.0;

/// Largest growth from one launch to the next.
const MOST_GROWTH: f64 = 4.0;

/// Most pixels of a launch at any speed, within the device's limits and the scratch memory of rays.
const MOST_PIXELS: u64 = 1 << 22;

/// The rectangle of the film that one launch computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Tile {
    /// Left edge.
    pub(crate) x: u32,
    /// Upper edge.
    pub(crate) y: u32,
    /// Pixels across.
    pub(crate) width: u32,
    /// Pixels down.
    pub(crate) height: u32,
}

impl Tile {
    /// A launch over the tile.
    pub(crate) fn launch(&self) -> Launch {
        self.of(&Launch::default())
    }

    /// The same launch over this tile.
    pub(crate) fn of(&self, launch: &Launch) -> Launch {
        Launch { tile_x: self.x, tile_y: self.y, tile_width: self.width, tile_height: self.height, ..*launch }
    }

    /// Its two halves, divided across the longer side; the second is empty where there is one pixel.
    pub(crate) fn halves(&self) -> [Self; 2] {
        let Self { x, y, width, height } = *self;
        if width > height {
            let left = width.div_ceil(2);
            return [Self { width: left, ..*self }, Self { x: x + left, width: width - left, ..*self }];
        }
        let upper = height.div_ceil(2);
        [Self { height: upper, ..*self }, Self { y: y + upper, height: height - upper, ..*self }]
    }

    /// Number of pixels.
    pub(crate) fn pixels(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }
}

/// How far a pass over the film has come. Bands above `y` are done, and in the band at `y` the columns left of `x`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Cursor {
    /// First column of the band that is not done.
    pub(crate) x: u32,
    /// First row of the band, a multiple of 8.
    pub(crate) y: u32,
}

/// Chooses the size of launches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slices {
    /// Samples of the next launch.
    budget: f64,
    most_pixels: u64,
    /// Number of launches so far, how many took too long, and the longest in seconds.
    launches: u64,
    too_long: u64,
    longest: f64,
}

impl Default for Slices {
    fn default() -> Self {
        Self { budget: FIRST_SAMPLES, most_pixels: MOST_PIXELS, launches: 0, too_long: 0, longest: 0.0 }
    }
}

impl Slices {
    /// The same with fewer pixels a launch, for launches that write a record for each pixel which is read back.
    pub(crate) fn of_records() -> Self {
        Self { most_pixels: 1 << 18, ..Self::default() }
    }

    /// The tile of the next launch, which adds `samples` to each of its pixels, and the cursor after it. `None` where the pass is done.
    pub(crate) fn next(&self, film: [u32; 2], at: Cursor, samples: u32) -> Option<(Tile, Cursor)> {
        let [film_width, film_height] = film;
        if at.y >= film_height || film_width == 0 {
            return None;
        }
        let pixels = ((self.budget / f64::from(samples.max(1))) as u64).clamp(1, self.most_pixels);
        let band = BAND.min(film_height - at.y);
        let width = film_width - at.x;
        let bands = pixels / (u64::from(film_width) * u64::from(BAND));
        if at.x == 0 && bands > 0 {
            let height = (bands.min(u64::from(film_height)) as u32 * BAND).min(film_height - at.y);
            let tile = Tile { x: 0, y: at.y, width, height };
            return Some((tile, Cursor { x: 0, y: at.y + height }));
        }
        // A part of a band, in whole workgroups.
        let columns = (pixels / u64::from(band)).next_multiple_of(8).max(8);
        let columns = columns.min(u64::from(width)) as u32;
        let tile = Tile { x: at.x, y: at.y, width: columns, height: band };
        let done = columns == width;
        let after =
            if done { Cursor { x: 0, y: at.y + band } } else { Cursor { x: at.x + columns, y: at.y } };
        Some((tile, after))
    }

    /// Most samples a pixel that one launch should add, so that a launch of eight by eight pixels fits the budget.
    pub(crate) fn most_samples(&self) -> u32 {
        (self.budget / f64::from(BAND * BAND)).clamp(1.0, 1e6) as u32
    }

    /// Adapts the budget to the time that a launch of `pixels` times `samples` took.
    pub(crate) fn learn(&mut self, pixels: u64, samples: u32, seconds: f64) {
        let done = pixels as f64 * f64::from(samples.max(1));
        let fits = done * AIM_SECONDS / seconds.max(1e-6);
        self.budget = fits.clamp(1.0, done.max(self.budget.min(done * MOST_GROWTH)) * MOST_GROWTH);
        self.launches += 1;
        self.longest = self.longest.max(seconds);
        self.too_long += u64::from(seconds > MOST_SECONDS);
    }

    /// Reduces the budget because the scene or the view has changed and samples may cost more.
    pub(crate) fn be_careful(&mut self) {
        self.budget = (self.budget / MOST_GROWTH).max(1.0);
    }

    /// After memory was short or the device was lost: launches have a quarter of the pixels from now on. False where they are as small as
    /// possible already.
    pub(crate) fn shrink(&mut self) -> bool {
        let smallest = u64::from(BAND * BAND);
        let can = self.most_pixels > smallest;
        self.most_pixels = (self.most_pixels / 4).max(smallest);
        self.budget = (self.budget / 4.0).max(1.0);
        can
    }

    /// Launches so far, how many of them took more than [`MOST_SECONDS`], and the longest in seconds.
    pub(crate) fn launches(&self) -> (u64, u64, f64) {
        (self.launches, self.too_long, self.longest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every pixel lies in exactly one launch of a pass, for any film size and speed.
    #[test]
    fn tiles_cover_the_film_once() {
        for film in [[1, 1], [7, 3], [8, 8], [130, 75], [1921, 17], [3, 200]] {
            for budget in [1.0, 50.0, 700.0, 9e3, 1e9] {
                for samples in [1, 3, 64] {
                    let slices = Slices { budget, ..Slices::default() };
                    let mut seen = vec![0u8; (film[0] * film[1]) as usize];
                    let mut at = Cursor::default();
                    while let Some((tile, after)) = slices.next(film, at, samples) {
                        for y in tile.y..tile.y + tile.height {
                            for x in tile.x..tile.x + tile.width {
                                seen[(y * film[0] + x) as usize] += 1;
                            }
                        }
                        assert_eq!(tile.y % 8, 0);
                        at = after;
                    }
                    assert!(seen.iter().all(|&n| n == 1), "{film:?} {budget} {samples}");
                }
            }
        }
    }

    /// Seconds of each launch on a device of a given speed, over several passes.
    fn simulated(
        film: [u32; 2],
        samples: u32,
        passes: u32,
        seconds_a_sample: impl Fn(&Tile) -> f64,
    ) -> Vec<f64> {
        let mut slices = Slices::default();
        let mut taken = Vec::new();
        for _ in 0..passes {
            let mut at = Cursor::default();
            while let Some((tile, after)) = slices.next(film, at, samples.min(slices.most_samples())) {
                let done = samples.min(slices.most_samples());
                let seconds = 50e-6 + tile.pixels() as f64 * f64::from(done) * seconds_a_sample(&tile);
                slices.learn(tile.pixels(), done, seconds);
                taken.push(seconds);
                at = after;
            }
        }
        taken
    }

    #[test]
    fn launches_stay_short_at_every_speed() {
        // From a software driver at 32 bounces to the fastest GPU.
        for seconds_a_sample in [3e-4, 2e-5, 1e-6, 1e-8, 1e-10] {
            for film in [[320, 200], [1920, 1080]] {
                let taken = simulated(film, 1, 3, |_| seconds_a_sample);
                let longest = taken.iter().fold(0.0f64, |m, &t| m.max(t));
                assert!(longest <= MOST_SECONDS, "{longest} s at {seconds_a_sample} s a sample");
                // There are not needlessly many launches either: their fixed cost must not matter.
                let work: f64 = taken.iter().sum();
                let most = work / (AIM_SECONDS * 0.3) + 60.0;
                assert!((taken.len() as f64) < most, "{} launches for {work} s", taken.len());
            }
        }
    }

    /// One half of the film costs eight times as much as the other: a few launches are too long, and later ones are not.
    #[test]
    fn a_costly_part_is_met_once() {
        let cost = |tile: &Tile| if tile.y < 540 { 1e-7 } else { 8e-7 };
        let taken = simulated([1920, 1080], 1, 2, cost);
        let long = taken.iter().filter(|&&t| t > MOST_SECONDS).count();
        assert!(long <= 2, "{long}");
        assert!(taken.iter().all(|&t| t < 8.0 * AIM_SECONDS * 1.1));
    }

    #[test]
    fn shrinking_ends() {
        let mut slices = Slices::default();
        let mut steps = 0;
        while slices.shrink() {
            steps += 1;
        }
        assert!((5..30).contains(&steps));
        assert!(slices.next([100, 100], Cursor::default(), 1).unwrap().0.pixels() <= 64);
    }
}
