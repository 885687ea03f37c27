//! Tests of the filter on pictures whose noise is drawn here, so that mean and variance are known.

use super::guides::likeness;
use super::*;
use crate::picture::Picture;

const SIDE: usize = 80;
/// Pixels from one to the furthest that it may become the mean of.
const REACH: usize = RADIUS * (1 + WIDE_STEPS[0] + WIDE_STEPS[1]);
const PIXELS: usize = SIDE * SIDE;
/// Pictures that make up a mean, as the film has classes.
const CLASSES: usize = 4;

/// What a picture shows, without noise: surface, light and its standard deviation in one class, by the pixel's place.
struct Truth<'a> {
    label: &'a dyn Fn(usize, usize) -> u32,
    light: &'a dyn Fn(usize, usize) -> f32,
    deviation: f32,
}

impl Truth<'_> {
    /// The picture of first surfaces.
    fn surfaces(&self) -> Picture {
        let label = (0..PIXELS).map(|i| (self.label)(i % SIDE, i / SIDE)).collect::<Vec<_>>();
        Picture {
            depth: Some(vec![1.0; PIXELS]),
            label: Some(label),
            normal: Some(Image::new(SIDE, SIDE, vec![[0.0, 0.0, 1.0]; PIXELS])),
            albedo: Some(Image::new(SIDE, SIDE, vec![[0.5, 0.25, 0.75]; PIXELS])),
            ..Picture::of(Image::new(SIDE, SIDE, vec![[0.0; 3]; PIXELS]))
        }
    }

    fn guides(&self) -> Guides {
        Guides::of(&self.surfaces()).unwrap().unwrap()
    }

    /// The mean of noisy pictures, and the variance that their spread tells.
    fn drawn(&self, seed: u64) -> (Image, Image) {
        let mut random = Random(seed);
        let (mut mean, mut variance) = (Vec::new(), Vec::new());
        for i in 0..PIXELS {
            let light = (self.light)(i % SIDE, i / SIDE);
            let of = |random: &mut Random| {
                let all: [f32; CLASSES] = std::array::from_fn(|_| light + self.deviation * random.normal());
                let n = CLASSES as f32;
                let mean = all.iter().sum::<f32>() / n;
                let squares: f32 = all.iter().map(|v| (v - mean) * (v - mean)).sum();
                (mean, squares / (n * (n - 1.0)))
            };
            let channels = [of(&mut random), of(&mut random), of(&mut random)];
            mean.push(channels.map(|c| c.0));
            variance.push(channels.map(|c| c.1));
        }
        (Image::new(SIDE, SIDE, mean), Image::new(SIDE, SIDE, variance))
    }
}

/// SplitMix64, and normal numbers by Box and Muller.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (((x ^ (x >> 31)) >> 40) as f32 + 0.5) / 16_777_216.0
    }

    fn normal(&mut self) -> f32 {
        let (a, b) = (self.uniform(), self.uniform());
        (-2.0 * a.ln()).sqrt() * (std::f32::consts::TAU * b).cos()
    }
}

fn filtered((mean, variance): &(Image, Image), guides: &Guides) -> Image {
    let known = Variance { of_mean: variance, degrees_of_freedom: (CLASSES - 1) as f64 };
    denoised_with(mean, Some(known), guides, WIDE_STEPS, &Job::new()).unwrap()
}

/// Without what the test needs to know it accepts everything.
fn untested((mean, _): &(Image, Image), guides: &Guides) -> Image {
    denoised_with(mean, None, guides, WIDE_STEPS, &Job::new()).unwrap()
}

/// Mean square difference from the truth, over the pixels that `count`.
fn error(image: &Image, truth: &Truth<'_>, count: impl Fn(usize, usize) -> bool) -> f64 {
    let places = (0..PIXELS).map(|i| (i % SIDE, i / SIDE)).filter(|&(x, y)| count(x, y));
    let (mut sum, mut n) = (0.0, 0.0);
    for (x, y) in places {
        for value in image.pixels[y * SIDE + x] {
            sum += f64::from(value - (truth.light)(x, y)).powi(2);
            n += 1.0;
        }
    }
    sum / n
}

/// Whether no window of a pixel is cut off by the picture's edge, nor a window of one that they hold.
fn inside(x: usize, y: usize) -> bool {
    let far = |v: usize| (REACH..SIDE - REACH).contains(&v);
    far(x) && far(y)
}

/// Weights of the pixels of a line, where each window gives the same to all of its pixels.
fn kernel(steps: &[usize]) -> Vec<f64> {
    let side = 2 * RADIUS + 1;
    steps.iter().fold(vec![1.0], |before, step| {
        let mut after = vec![0.0; before.len() + 2 * RADIUS * step];
        for far in 0..side {
            before.iter().enumerate().for_each(|(i, w)| after[i + far * step] += w / side as f64);
        }
        after
    })
}

/// What is left of the variance of independent pixels that are averaged with these weights along both axes.
fn share_left(kernel: &[f64]) -> f64 {
    kernel.iter().map(|w| w * w).sum::<f64>().powi(2)
}

/// What windows find.
fn means_of(window: &impl Window) -> Means {
    let mut means = Means::zeroes(window.layout()).unwrap();
    window.find(&mut means, &Job::new());
    means
}

#[test]
fn variance_of_a_constant_falls_as_the_windows_say() {
    let truth = Truth { label: &|_, _| 1, light: &|_, _| 2.0, deviation: 0.4 };
    let guides = truth.guides();
    let (mut tested, mut all, mut first) = (0.0, 0.0, 0.0);
    let pictures = 32;
    for seed in 0..pictures {
        let picture = truth.drawn(seed);
        let share = |image: &Image| error(image, &truth, inside) / f64::from(pictures as u32);
        tested += share(&filtered(&picture, &guides));
        all += share(&untested(&picture, &guides));
        let light = Light::of(&picture.0, None, &guides).unwrap();
        let window = FirstWindow {
            guides: &guides,
            light: &light,
            test: WelchTest::of(None),
            is_variance_known: false,
        };
        let means = means_of(&window);
        let pixel = |i: usize| {
            let at = guides.layout.place(i % SIDE, i / SIDE);
            std::array::from_fn(|c| means.mean[c][at] * divisor(guides.albedo[c][at]))
        };
        first += share(&Image::new(SIDE, SIDE, (0..PIXELS).map(pixel).collect()));
    }
    let noise = 0.4f64.powi(2) / CLASSES as f64;
    let near = noise * share_left(&kernel(&[1]));
    let wide = noise * share_left(&kernel(&[1, WIDE_STEPS[0], WIDE_STEPS[1]]));
    // 32 pictures of 28² pixels and 3 channels hold 32 · 3 · 784 / 25 = 3010 independent first windows: their mean square has a standard error
    // of √(2/3010) = 2.6 %, and five of them are allowed.
    assert!((first / near - 1.0).abs() < 0.13, "{first} of {near}");
    // The wide windows leave out what differs by more than noise would in nine of ten, the furthest off, in each channel; they overlap themselves,
    // so that less differs.
    let after_windows = 0.8 * wide..6.0 * wide;
    assert!(after_windows.contains(&all) && all < 0.1 * near, "{all}, {wide}, {near}");
    // Where the variance is known a share k of the noise comes back: 1 - the quotient of two sums over 81 pixels and 3 channels, of squares with one degree
    // of freedom and of variances with three. It varies by 2 / 243 + 2 / (3 * 243), and the half above 0 counts, of which each square is k² of the noise.
    let back = noise * 0.5 * (2.0 + 2.0 / 3.0) / 243.0;
    assert!((0.8 * back..6.0 * wide + 1.2 * back).contains(&tested), "{tested}, {back}, {wide}");
}

/// The variance of a mean of the second window, whose pixels share pixels of the first one, beside that of the light that was drawn.
#[test]
fn variance_of_the_second_window_is_that_of_its_means() {
    let truth = Truth { label: &|_, _| 1, light: &|_, _| 2.0, deviation: 0.4 };
    let guides = truth.guides();
    let expected = 0.4f64.powi(2) / CLASSES as f64 * share_left(&kernel(&[1, WIDE_STEPS[0]]));
    // A test that accepts all that noise alone makes differ.
    let test = WelchTest::new(1e-6, 24.0);
    let (mut sum, mut n) = (0.0, 0.0);
    for seed in 0..8 {
        let light = Light::of(&truth.drawn(seed).0, None, &guides).unwrap();
        let (of_first, is_variance_known) = (WelchTest::of(None), false);
        let first =
            means_of(&FirstWindow { guides: &guides, light: &light, test: of_first, is_variance_known });
        let second = WideWindow {
            guides: &guides,
            takes_part: &light.takes_part,
            from: &first,
            test,
            step: WIDE_STEPS[0],
        };
        let means = means_of(&second);
        for (x, y) in (0..PIXELS).map(|i| (i % SIDE, i / SIDE)).filter(|&(x, y)| inside(x, y)) {
            let at = guides.layout.place(x, y);
            for c in 0..3 {
                sum += f64::from(means.variance[c][at] * divisor(guides.albedo[c][at]).powi(2));
                n += 1.0;
            }
        }
    }
    // 8 pictures of 28² pixels and 3 channels hold 8 · 3 · 784 / 25 = 753 independent windows of 24 degrees of freedom: their mean has a standard
    // error of √(2/18063) = 1.1 %, and four of them are allowed.
    assert!((sum / n / expected - 1.0).abs() < 0.044, "{} of {expected}", sum / n);
}

/// The variance of a mean of the first window, from those of its pixels or from how they differ, beside that of the light that was drawn.
#[test]
fn variance_of_the_first_window_is_that_of_its_means() {
    let truth = Truth { label: &|_, _| 1, light: &|_, _| 2.0, deviation: 0.4 };
    let guides = truth.guides();
    let expected = 0.4f64.powi(2) / CLASSES as f64 / ((2 * RADIUS + 1) * (2 * RADIUS + 1)) as f64;
    // 24 pictures of 28² pixels and 3 channels hold 2258 independent windows of 24 degrees of freedom: their mean has a standard error of
    // √(2/54190) = 0.6 %, and four of them are allowed. Of a pixel's own variance the greater of it and its neighbours' counts, which is larger
    // than the true one by up to a half.
    for (known, ratio) in [(false, 0.976..1.024), (true, 1.0..1.5)] {
        let (mut sum, mut n) = (0.0, 0.0);
        for seed in 0..24 {
            let (mean, variance) = truth.drawn(seed);
            let light = Light::of(&mean, known.then_some(&variance), &guides).unwrap();
            let test = WelchTest::of(known.then_some((CLASSES - 1) as f64));
            let window = FirstWindow { guides: &guides, light: &light, test, is_variance_known: known };
            let means = means_of(&window);
            let places = (0..PIXELS).map(|i| (i % SIDE, i / SIDE)).filter(|&(x, y)| inside(x, y));
            for at in places.map(|(x, y)| guides.layout.place(x, y)) {
                for c in 0..3 {
                    sum += f64::from(means.variance[c][at] * divisor(guides.albedo[c][at]).powi(2));
                    n += 1.0;
                }
            }
        }
        assert!(ratio.contains(&(sum / n / expected)), "{known}: {} of {expected}", sum / n);
    }
}

/// Where no variance is known: the mean of a window in which surfaces differ, and its variance, from sums in f64 of two passes. With
/// weights w, mean m and n = (Σw)²/Σw² pixels of equal weight, the variance is Σw(v − m)²/Σw / (n − 1).
#[test]
fn a_variance_from_differences_is_that_of_a_weighted_mean() {
    let truth = Truth { label: &|_, _| 1, light: &|_, _| 2.0, deviation: 0.4 };
    let mut random = Random(5);
    let mut surfaces = truth.surfaces();
    let tilted = |x: f32| [x, 0.0, (1.0 - x * x).sqrt()];
    let normals = (0..PIXELS).map(|_| tilted(2.0 * random.uniform() - 1.0)).collect::<Vec<_>>();
    surfaces.normal = Some(Image::new(SIDE, SIDE, normals.clone()));
    let guides = Guides::of(&surfaces).unwrap().unwrap();
    let (mean, _) = truth.drawn(11);
    let light = Light::of(&mean, None, &guides).unwrap();
    let window =
        FirstWindow { guides: &guides, light: &light, test: WelchTest::of(None), is_variance_known: false };
    let means = means_of(&window);
    let (mut least, mut most) = (f64::MAX, 0.0f64);
    for (x, y) in (0..PIXELS).map(|i| (i % SIDE, i / SIDE)).filter(|&(x, y)| inside(x, y)) {
        for c in 0..3 {
            let d = f64::from(divisor([0.5, 0.25, 0.75][c]));
            let rows = y - RADIUS..=y + RADIUS;
            let places = rows.flat_map(|v| (x - RADIUS..=x + RADIUS).map(move |u| v * SIDE + u));
            let own = normals[y * SIDE + x];
            let weighted = places.map(|i| {
                let squared = (0..3).map(|k| (normals[i][k] - own[k]).powi(2)).sum::<f32>();
                (f64::from(likeness(squared, 0.0)), f64::from(mean.pixels[i][c]) / d)
            });
            let weighted = weighted.collect::<Vec<_>>();
            let sum = |of: &dyn Fn(f64, f64) -> f64| weighted.iter().map(|&(w, v)| of(w, v)).sum::<f64>();
            let all = sum(&|w, _| w);
            let m = sum(&|w, v| w * v) / all;
            let count = all * all / sum(&|w, _| w * w);
            let variance = sum(&|w, v| w * (v - m).powi(2)) / all / (count - 1.0);
            (least, most) = (least.min(count), most.max(count));
            let at = guides.layout.place(x, y);
            // 25 sums of floats, each within 2⁻²⁴ of a value of order 1, the spread around the pixel's own light up to some ten times the
            // variance.
            assert!((f64::from(means.mean[c][at]) / m - 1.0).abs() < 1e-5, "{x} {y} {c}");
            assert!((f64::from(means.variance[c][at]) / variance - 1.0).abs() < 1e-4, "{x} {y} {c}");
        }
    }
    // Weights differ, so that the sum of their squares is not the sum of them.
    assert!(least < 20.0 && most > least + 2.0, "{least} {most}");
}

/// One sample a pixel, of which one in twenty found a bright light: what the wide window makes of the first one's means has as much light.
#[test]
fn rare_bright_samples_keep_their_light_where_no_variance_is_known() {
    let truth = Truth { label: &|_, _| 1, light: &|_, _| 0.1, deviation: 0.02 };
    let guides = truth.guides();
    let mut random = Random(9);
    let (mut before, mut after) = (0.0, 0.0);
    for seed in 0..8 {
        let (mut mean, variance) = truth.drawn(seed);
        for pixel in &mut mean.pixels {
            if random.uniform() < 0.05 {
                *pixel = [4.0; 3];
            }
        }
        let smooth = untested(&(mean.clone(), variance), &guides);
        for (x, y) in (0..PIXELS).map(|i| (i % SIDE, i / SIDE)).filter(|&(x, y)| inside(x, y)) {
            before += f64::from(mean.pixels[y * SIDE + x][0]);
            after += f64::from(smooth.pixels[y * SIDE + x][0]);
        }
    }
    assert!((after / before - 1.0).abs() < 0.06, "{}", after / before);
}

#[test]
fn a_step_between_two_labels_stays_exact() {
    let truth = Truth {
        label: &|x, _| if x < SIDE / 2 { 7 } else { 9 },
        light: &|x, _| if x < SIDE / 2 { 0.25 } else { 4.0 },
        deviation: 0.0,
    };
    let (mean, variance) = truth.drawn(1);
    let guides = truth.guides();
    assert_eq!(untested(&(mean.clone(), variance), &guides), mean, "each label has one light");
    // The control: as one label, the step is blurred.
    let one = Truth { label: &|_, _| 7, ..truth };
    assert_ne!(denoised(&mean, None, &one.guides()).unwrap(), mean);
}

#[test]
fn instances_of_one_volume_are_kept_apart_though_their_labels_are_equal() {
    let truth =
        Truth { label: &|_, _| 3, light: &|x, _| if x < SIDE / 2 { 1.0 } else { 2.0 }, deviation: 0.0 };
    let (mean, _) = truth.drawn(1);
    assert_ne!(denoised(&mean, None, &truth.guides()).unwrap(), mean);
    let instance = Some((0..PIXELS).map(|i| u32::from(i % SIDE < SIDE / 2)).collect());
    let guides = Guides::of(&Picture { instance, ..truth.surfaces() }).unwrap().unwrap();
    assert_eq!(denoised(&mean, None, &guides).unwrap(), mean);
}

/// A shadow's edge, which no surface tells. Its two sides are 30 standard errors apart: of t with 3 degrees of freedom, on which the edge of
/// acceptance is 5.8, one pair in 60 is still accepted where both variances came out small.
#[test]
fn means_that_really_differ_are_not_mixed() {
    let truth =
        Truth { label: &|_, _| 1, light: &|x, _| if x < SIDE / 2 { 1.0 } else { 4.0 }, deviation: 0.2 };
    let at_edge = |x: usize, y: usize| x.abs_diff(SIDE / 2) <= 3 && inside(x, y);
    let (guides, picture) = (truth.guides(), truth.drawn(5));
    let noise = error(&picture.0, &truth, at_edge);
    let tested = error(&filtered(&picture, &guides), &truth, at_edge);
    assert!(tested < 0.3 * noise, "{tested} of {noise}");
    // The control: without the test, pixels beside the edge take a third of their light from the other side.
    let untested = error(&untested(&picture, &guides), &truth, at_edge);
    assert!(untested > 30.0 * noise, "{untested} of {noise}");
}

/// A shadow's edge at one sample a pixel: how the pixels of a first window differ is enough to tell its mean from one of the other side. So pixels
/// further from the edge than the first window reaches get no light of the other side, though the wide window reads it.
#[test]
fn the_wide_window_keeps_to_its_side_of_a_shadow_where_no_variance_is_known() {
    let truth =
        Truth { label: &|_, _| 1, light: &|x, _| if x < SIDE / 2 { 1.0 } else { 4.0 }, deviation: 0.2 };
    let beside = |x: usize, y: usize| (3..=6).contains(&x.abs_diff(SIDE / 2)) && inside(x, y);
    let (guides, (mean, _)) = (truth.guides(), truth.drawn(5));
    let light = Light::of(&mean, None, &guides).unwrap();
    let window =
        FirstWindow { guides: &guides, light: &light, test: WelchTest::of(None), is_variance_known: false };
    let smooth = means_of(&window);
    let wide = |test: WelchTest| {
        let mut image = mean.clone();
        let takes_part = &light.takes_part;
        WideWindow { guides: &guides, takes_part, from: &smooth, test, step: WIDE_STEPS[0] }
            .fill(&mut image.pixels, &Job::new());
        error(&image, &truth, beside)
    };
    let noise = error(&mean, &truth, beside);
    let tested = wide(WelchTest::wide());
    assert!(tested < 0.1 * noise, "{tested} of {noise}");
    // The control: what accepts everything takes two fifths of the light from the other side.
    let accepts = wide(WelchTest::new(1e-9, 1.0));
    assert!(accepts > 50.0 * noise, "{accepts} of {noise}");
}

/// One sample of four found a highlight: mean and standard error are 25, so the test accepts that it equals the dark pixels around. Those that do not
/// touch it get a weight of it of about 8 · 1e-4 / 625 each, and some of what those that touch it get, with whose variance its own is pooled.
#[test]
fn a_noisy_highlight_stays_out_of_the_quiet_pixels_around_it() {
    let truth = Truth { label: &|_, _| 1, light: &|_, _| 0.1, deviation: 0.02 };
    let (mut mean, mut variance) = truth.drawn(4);
    let middle = SIDE / 2 * SIDE + SIDE / 2;
    mean.pixels[middle] = [25.0; 3];
    variance.pixels[middle] = [625.0; 3];
    let picture = (mean, variance);
    let around = |x: usize, y: usize| {
        let near = |v: usize| v.abs_diff(SIDE / 2) <= RADIUS && v.abs_diff(SIDE / 2) > 1;
        near(x) && near(y)
    };
    let after = filtered(&picture, &truth.guides());
    assert!(error(&after, &truth, around) < 5e-5, "{}", error(&after, &truth, around));
    assert!(after.pixels[middle][0] < 2.0, "the highlight itself becomes the mean of its window");
    // The control: where nothing is known of noise, the windows spread it: these pixels have it in 9 of their 25³ places, 0.014² of its 25.
    let blind = error(&untested(&picture, &truth.guides()), &truth, around);
    assert!(blind > 1e-4, "{blind}");
}

/// All samples of one pixel missed the light, so it seems to be exactly black. The pixels around it tell that it is not.
#[test]
fn a_pixel_that_seems_exact_has_the_variance_of_its_surroundings() {
    let truth = Truth { label: &|_, _| 1, light: &|_, _| 1.0, deviation: 1.0 };
    let (mut mean, mut variance) = truth.drawn(4);
    let middle = SIDE / 2 * SIDE + SIDE / 2;
    mean.pixels[middle] = [0.0; 3];
    variance.pixels[middle] = [0.0; 3];
    let after = filtered(&(mean.clone(), variance.clone()), &truth.guides());
    assert!(after.pixels[middle].iter().all(|c| (0.5..1.5).contains(c)), "{:?}", after.pixels[middle]);
    // The control: of a label of its own, it stays as it is.
    let alone = Truth { label: &|x, y| if (x, y) == (SIDE / 2, SIDE / 2) { 2 } else { 1 }, ..truth };
    assert_eq!(filtered(&(mean, variance), &alone.guides()).pixels[middle], [0.0; 3]);
}

#[test]
fn a_picture_without_noise_is_unchanged_to_the_bit() {
    let light = |x: usize, y: usize| 0.1 + ((x * 7 + y * 13) % 11) as f32 / 3.0;
    let truth = Truth { label: &|_, _| 1, light: &light, deviation: 0.0 };
    let (mean, _) = truth.drawn(1);
    let exact = Image::new(SIDE, SIDE, vec![[0.0; 3]; PIXELS]);
    assert_eq!(filtered(&(mean.clone(), exact), &truth.guides()), mean);
    // The control: with noise that explains the differences, it is changed.
    let loose = Image::new(SIDE, SIDE, vec![[100.0; 3]; PIXELS]);
    assert_ne!(filtered(&(mean.clone(), loose), &truth.guides()), mean);
}

/// Light that rises across the picture, as on a curved surface: the test cannot tell neighbours apart until there are samples enough.
#[test]
fn bias_vanishes_as_samples_are_added() {
    let ramp = |x: usize, y: usize| 1.0 + 0.02 * ((x * x) as f32 + y as f32) / SIDE as f32;
    let mut last = f64::INFINITY;
    let mut biases = Vec::new();
    for samples in [1.0f32, 64.0, 4096.0, 262_144.0] {
        let truth = Truth { label: &|_, _| 1, light: &ramp, deviation: 0.5 / samples.sqrt() };
        let guides = truth.guides();
        // The mean of many pictures is biased as one is, and less noisy.
        let mut sum = vec![0.0f64; PIXELS];
        let pictures = 16;
        for seed in 0..pictures {
            let (mean, variance) = truth.drawn(seed);
            let smooth = filtered(&(mean.clone(), variance), &guides);
            let difference = smooth.pixels.iter().zip(&mean.pixels).map(|(a, b)| f64::from(a[0] - b[0]));
            sum.iter_mut().zip(difference).for_each(|(sum, d)| *sum += d / pictures as f64);
        }
        let bias = (sum.iter().map(|d| d * d).sum::<f64>() / PIXELS as f64).sqrt();
        assert!(bias < last, "{samples}: {bias} after {last}");
        last = bias;
        biases.push(bias);
    }
    // With the most samples the filtered picture is the unfiltered one, but for a hundredth of the first difference.
    assert!(biases[3] < 0.01 * biases[0], "{biases:?}");
}

/// Light of every other pixel, so fine that the test of two pixels cannot tell it from noise, while that of a whole window's surroundings is larger than
/// noise. The best mixture of noise 0.1² and of what is blurred, 0.15², has 0.69 times the error of the noise.
#[test]
fn what_noise_does_not_explain_comes_back() {
    let light = |x: usize, y: usize| if (x + y).is_multiple_of(2) { 0.85 } else { 1.15 };
    let truth = Truth { label: &|_, _| 1, light: &light, deviation: 0.2 };
    let (guides, picture) = (truth.guides(), truth.drawn(8));
    let noise = error(&picture.0, &truth, inside);
    let after = error(&filtered(&picture, &guides), &truth, inside);
    assert!(after < 0.8 * noise, "{after} of {noise}");
    // The control: where nothing is known of noise, the pattern is blurred.
    let blurred = error(&untested(&picture, &guides), &truth, inside);
    assert!(blurred > 2.0 * noise, "{blurred} of {noise}");
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let truth =
        Truth { label: &|x, y| 1 + (x / 5 + y / 7) as u32, light: &|_, y| 1.0 + y as f32, deviation: 0.5 };
    let (guides, picture) = (truth.guides(), truth.drawn(3));
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| filtered(&picture, &guides))
    };
    assert_eq!(with(1), with(5));
}

#[test]
fn background_and_what_is_no_number_stay_and_harm_no_neighbour() {
    let truth = Truth { label: &|_, _| 1, light: &|_, _| 1.0, deviation: 0.3 };
    let (mut mean, mut variance) = truth.drawn(2);
    let mut surfaces = truth.surfaces();
    for (place, odd) in
        [(0, f32::NAN), (57, f32::INFINITY), (300, -f32::INFINITY), (555, f32::MAX), (900, 1e30)]
    {
        mean.pixels[place] = [odd, 1.0, odd];
    }
    for (place, odd) in [(1, f32::NAN), (58, f32::INFINITY), (301, -1.0), (556, f32::MAX), (901, 0.0)] {
        variance.pixels[place] = [odd; 3];
    }
    // Nothing is seen there, or what is seen is no number.
    for (place, odd) in [(700, f32::INFINITY), (701, f32::NAN)] {
        surfaces.depth.as_mut().unwrap()[place] = odd;
    }
    surfaces.normal.as_mut().unwrap().pixels[702] = [0.0, f32::NAN, 0.0];
    surfaces.albedo.as_mut().unwrap().pixels[703] = [f32::INFINITY, 0.5, 0.5];
    surfaces.albedo.as_mut().unwrap().pixels[704] = [0.5, -0.01, 0.5];
    let guides = Guides::of(&surfaces).unwrap().unwrap();
    let before = mean.clone();
    let after = filtered(&(mean, variance), &guides);
    for (i, (a, b)) in before.pixels.iter().zip(&after.pixels).enumerate() {
        if [0, 57, 300, 555, 700, 701, 702, 703, 704, 900].contains(&i) {
            assert_eq!(a.map(f32::to_bits), b.map(f32::to_bits), "{i}");
        } else {
            assert!(b.iter().all(|c| (0.0..3.0).contains(c)), "{i}: {b:?}");
        }
    }
}

#[test]
fn pictures_of_any_size_are_filtered() {
    for (width, height) in [(1, 1), (1, 9), (9, 1), (2, 3), (RADIUS, RADIUS), (33, 2)] {
        let image = |value: f32| Image::new(width, height, vec![[value; 3]; width * height]);
        let picture = Picture {
            depth: Some(vec![1.0; width * height]),
            label: Some(vec![1; width * height]),
            normal: Some(image(0.5)),
            albedo: Some(image(0.5)),
            ..Picture::of(image(1.5))
        };
        let guides = Guides::of(&picture).unwrap().unwrap();
        assert_eq!(denoised(&picture.color, None, &guides).unwrap(), picture.color, "{width} × {height}");
        let variance = image(f32::INFINITY);
        let unknown = Variance { of_mean: &variance, degrees_of_freedom: 3.0 };
        assert_eq!(denoised(&picture.color, Some(unknown), &guides).unwrap(), picture.color);
    }
}

/// A spot of light without noise in the middle, of which a pixel 18 away gets some where there is a third window, which means one 9 away.
#[test]
fn small_pictures_have_no_third_window() {
    let reached = |width: usize, height: usize| {
        let image = |value: f32| Image::new(width, height, vec![[value; 3]; width * height]);
        let mut color = image(1.0);
        color.pixels[height / 2 * width + width / 2] = [1.5; 3];
        let picture = Picture {
            depth: Some(vec![1.0; width * height]),
            label: Some(vec![1; width * height]),
            normal: Some(image(0.5)),
            albedo: Some(image(0.5)),
            ..Picture::of(color)
        };
        let smooth = denoised(&picture.color, None, &Guides::of(&picture).unwrap().unwrap()).unwrap();
        smooth.pixels[height / 2 * width + width / 2 + 18] != [1.0; 3]
    };
    assert!(reached(LEAST_SIDE, LEAST_SIDE + 1) && !reached(LEAST_SIDE, LEAST_SIDE - 1));
    assert!(!reached(LEAST_SIDE - 1, LEAST_SIDE));
}

#[test]
fn what_does_not_fit_is_left_as_it_is() {
    let truth = Truth { label: &|_, _| 1, light: &|_, _| 1.0, deviation: 0.3 };
    let (mean, _) = truth.drawn(2);
    let other = Image::new(2, 2, vec![[1.0; 3]; 4]);
    assert_eq!(denoised(&other, None, &truth.guides()).unwrap(), other);
    let known = Variance { of_mean: &other, degrees_of_freedom: 3.0 };
    assert_eq!(denoised(&mean, Some(known), &truth.guides()).unwrap(), mean);
    assert!(Guides::of(&Picture::of(mean)).unwrap().is_none());
}

/// Opposite faces have nothing in common, and faces at a right angle a sixteenth of what others have.
#[test]
fn faces_are_told_apart_by_their_normals() {
    let image = Image::new(3, 1, vec![[0.0; 3], [1.0; 3], [0.0; 3]]);
    let middle = |normal: [f32; 3]| {
        let picture = Picture {
            depth: Some(vec![1.0; 3]),
            label: Some(vec![1; 3]),
            normal: Some(Image::new(3, 1, vec![normal, [0.0, 0.0, 1.0], normal])),
            albedo: Some(Image::new(3, 1, vec![[0.5; 3]; 3])),
            ..Picture::of(image.clone())
        };
        denoised(&image, None, &Guides::of(&picture).unwrap().unwrap()).unwrap().pixels[1][0]
    };
    // The pixel itself counts 1, each of its two neighbours w: 1 / (1 + 2w).
    for (normal, weight) in [([0.0, 0.0, 1.0], 1.0), ([1.0, 0.0, 0.0], 1.0 / 16.0), ([0.0, 0.0, -1.0], 0.0)] {
        assert!((middle(normal) - 1.0 / (1.0 + 2.0 * weight)).abs() < 1e-6, "{normal:?}: {}", middle(normal));
    }
}

#[test]
fn base_colors_that_differ_visibly_are_not_mixed() {
    let truth =
        Truth { label: &|_, _| 1, light: &|x, _| if x < SIDE / 2 { 1.0 } else { 2.0 }, deviation: 0.0 };
    let (mean, _) = truth.drawn(1);
    let painted = |right: f32| {
        let pixel = |i: usize| [if i % SIDE < SIDE / 2 { 0.4 } else { right }; 3];
        let albedo = Some(Image::new(SIDE, SIDE, (0..PIXELS).map(pixel).collect()));
        Guides::of(&Picture { albedo, ..truth.surfaces() }).unwrap().unwrap()
    };
    assert_eq!(denoised(&mean, None, &painted(0.5)).unwrap(), mean);
    assert_ne!(denoised(&mean, None, &painted(0.4)).unwrap(), mean);
}

/// The same light on two surfaces, one of a tenth of the other's base colour: 0.01 is added to both. It is so bright that the 0.01 which is added to
/// the squares of colours is nothing.
#[test]
fn what_is_filtered_of_light_does_not_depend_on_the_base_color_under_it() {
    let light = |x: usize, _| if x < SIDE / 2 { 1000.0 } else { 2000.0 };
    let truth = Truth { label: &|_, _| 1, light: &light, deviation: 400.0 };
    let (mean, variance) = truth.drawn(6);
    let of = |albedo: f32, scale: f32| {
        let albedo = Some(Image::new(SIDE, SIDE, vec![[albedo; 3]; PIXELS]));
        let guides = Guides::of(&Picture { albedo, ..truth.surfaces() }).unwrap().unwrap();
        filtered(
            &(mean.map(|p| p.map(|v| v * scale)), variance.map(|p| p.map(|v| v * scale * scale))),
            &guides,
        )
    };
    for (bright, dark) in of(0.99, 1.0).pixels.iter().flatten().zip(of(0.09, 0.1).pixels.iter().flatten()) {
        assert!((bright - 10.0 * dark).abs() < 1e-4 * bright, "{bright} {dark}");
    }
}

/// Exact light on one label beside noise on another: the noise says nothing of the exact light.
#[test]
fn variance_is_pooled_within_a_label() {
    let light = |x: usize, y: usize| if x < SIDE / 2 { 1.0 + (y % 2) as f32 } else { 5.0 };
    let truth = Truth { label: &|x, _| if x < SIDE / 2 { 1 } else { 2 }, light: &light, deviation: 0.0 };
    let (mean, mut variance) = truth.drawn(1);
    for (i, pixel) in variance.pixels.iter_mut().enumerate().filter(|(i, _)| i % SIDE >= SIDE / 2) {
        *pixel = [1.0 + i as f32; 3];
    }
    assert_eq!(filtered(&(mean.clone(), variance), &truth.guides()), mean);
}

/// On a border that each pixel mixes with black in a share of its own, the same light falls on all of it.
#[test]
fn light_is_carried_over_between_pixels_that_an_edge_mixes_differently() {
    let share = |i: usize| 0.9 + 0.02 * ((i * 31) % 5) as f32;
    let mixed = |i: usize| [0.5, 0.25, 0.75].map(|own| own * share(i));
    let albedo = Some(Image::new(SIDE, SIDE, (0..PIXELS).map(mixed).collect()));
    let surfaces = Truth { label: &|_, _| 1, light: &|_, _| 1.0, deviation: 0.0 }.surfaces();
    let guides = Guides::of(&Picture { albedo, ..surfaces }).unwrap().unwrap();
    // 0.01 is added to base colours, so light is what is left exactly.
    let pixel = |i: usize| mixed(i).map(|albedo| 3.0 * divisor(albedo));
    let image = Image::new(SIDE, SIDE, (0..PIXELS).map(pixel).collect());
    let after = denoised(&image, None, &guides).unwrap();
    for (a, b) in image.pixels.iter().zip(&after.pixels) {
        // Rounding of a quotient and a product in single precision.
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5), "{a:?} {b:?}");
    }
}

#[test]
fn a_cancelled_picture_is_not_given() {
    let truth = Truth { label: &|_, _| 1, light: &|x, _| x as f32, deviation: 1.0 };
    let (guides, (mean, variance)) = (truth.guides(), truth.drawn(3));
    let of = |job: &Job| {
        let known = Variance { of_mean: &variance, degrees_of_freedom: (CLASSES - 1) as f64 };
        denoised_unless_cancelled(&mean, Some(known), &guides, job).unwrap()
    };
    let cancelled = Job::new();
    cancelled.cancel();
    assert_eq!(of(&cancelled), None);
    let known = Variance { of_mean: &variance, degrees_of_freedom: (CLASSES - 1) as f64 };
    assert_eq!(of(&Job::new()), Some(denoised(&mean, Some(known), &guides).unwrap()));
}
