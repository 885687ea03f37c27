//! Which pixels of a film make up a frame of fewer pixels: for each of the frame's the one in the middle of what it covers.

/// A frame of fewer pixels than its film.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CoarsePixels {
    film: [u32; 2],
    frame: [u32; 2],
}

impl CoarsePixels {
    /// A frame of this size of a film of that size, in pixels across and down. A frame that is no smaller shows pixels more than once.
    pub fn new(film: [u32; 2], frame: [u32; 2]) -> Self {
        Self { film, frame }
    }

    /// Pixels of the frame across and down.
    pub fn size(&self) -> [u32; 2] {
        self.frame
    }

    /// Pixels of the film across and down.
    pub fn film(&self) -> [u32; 2] {
        self.film
    }

    /// Columns of the film that the frame shows, from the left.
    pub fn columns(&self) -> impl Iterator<Item = u32> {
        let Self { film, frame } = *self;
        (0..frame[0]).map(move |x| middle(x, frame[0], film[0]))
    }

    /// Rows of the film that the frame shows, from the top.
    pub fn rows(&self) -> impl Iterator<Item = u32> {
        let Self { film, frame } = *self;
        (0..frame[1]).map(move |y| middle(y, frame[1], film[1]))
    }

    /// The pixel of the film that a pixel of the frame shows; both from the left and from the top.
    pub fn pixel(&self, x: u32, y: u32) -> [u32; 2] {
        [middle(x, self.frame[0], self.film[0]), middle(y, self.frame[1], self.film[1])]
    }
}

/// Where `count` of a frame lie over `all` of the film, the film's in the middle of the frame's.
fn middle(of: u32, count: u32, all: u32) -> u32 {
    ((2 * u64::from(of) + 1) * u64::from(all) / (2 * u64::from(count.max(1)))) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_lie_in_the_middle_and_inside() {
        let columns = |film, frame| CoarsePixels::new([film, 1], [frame, 1]).columns().collect::<Vec<_>>();
        assert_eq!(columns(8, 4), [1, 3, 5, 7]);
        assert_eq!(columns(8, 2), [2, 6]);
        assert_eq!(columns(10, 3), [1, 5, 8]);
        assert_eq!(columns(1, 1), [0]);
        assert_eq!(columns(2, 4), [0, 0, 1, 1]);
        for (film, frame) in [(65_536, 8_192), (1001, 126), (7, 7), (1920, 240)] {
            let found = columns(film, frame);
            assert!(found.windows(2).all(|w| w[0] < w[1]), "{film}, {frame}");
            // As far from the left edge as from the right one, to one pixel.
            let (left, right) = (found[0], film - 1 - found[frame as usize - 1]);
            assert!(left.abs_diff(right) <= 1, "{film}, {frame}: {left} {right}");
        }
    }

    #[test]
    fn a_pixel_lies_in_its_column_and_row() {
        let pixels = CoarsePixels::new([9, 6], [3, 2]);
        for (y, row) in (0..).zip(pixels.rows()) {
            for (x, column) in (0..).zip(pixels.columns()) {
                assert_eq!(pixels.pixel(x, y), [column, row]);
            }
        }
        assert_eq!((pixels.pixel(0, 0), pixels.pixel(2, 1)), ([1, 1], [7, 4]));
    }
}
