//! The slices in which a voxel's neighbours lie, with borders of background: the slice being coded and those before it.
//!
//! ```text
//! two slabs of four slices, used in turn:  ┌────┬────┬────┬────┐   ┌────┬────┬────┬────┐
//!                                          │ z−5│ z−4│ z−3│ z−2│   │ z−1│  z │    │    │      a full slab is passed on without a copy
//!                                          └────┴────┴────┴────┘   └────┴────┴────┴────┘
//! a slice:  rows of    8 of border │ voxels, up to a multiple of 64 │ 16 of border        three rows of border above and below
//! ```
//! Borders are as wide as the farthest neighbour. Writes of 16 voxels at a time may pass a row's end; the border is cleared afterwards.

/// Slices of a slab, so that a slab has whole cells whatever its first z is. With sixteen slices, which leave the caches, opening takes 6 %
/// longer.
pub(super) const SLAB: usize = 4;

/// Border voxels before a row.
pub(super) const BORDER: usize = 8;

/// Border voxels after a row: as many as [`fill`] writes at a time.
const BEHIND: usize = 16;

/// Border rows above and below a slice.
const ROWS: usize = 3;

/// Number of 64-bit words that hold a bit for each of `columns` voxels and for the one after the last.
pub(super) fn words(columns: usize) -> usize {
    columns / 64 + 1
}

/// Two slabs of slices with borders; the module documentation draws them.
#[derive(Debug)]
pub(super) struct Slices {
    columns: usize,
    rows: usize,
    /// Distances in voxels from one row to the next (`stride`) and from one slice to the next (`area`).
    stride: usize,
    area: usize,
    slab: Vec<u32>,
    former: Vec<u32>,
    /// Number of slices of the slab that have begun, including the one being coded.
    begun: usize,
}

/// The slice being coded and the two before it.
pub(super) struct Three<'a> {
    now: &'a mut [u32],
    before: [&'a [u32]; 2],
    stride: usize,
}

/// The decoded rows around the one being coded, with their borders. The names give the direction along y and the number of slices back.
pub(super) struct Around<'a> {
    pub(super) up: &'a [u32],
    pub(super) up_2: &'a [u32],
    pub(super) back: &'a [u32],
    pub(super) back_up: &'a [u32],
    pub(super) back_down: &'a [u32],
    pub(super) back_2: &'a [u32],
    /// The decoded part of the current slice, the two slices before it, and the offset at which the row begins in them.
    slices: [&'a [u32]; 3],
    at: usize,
    stride: usize,
}

impl Slices {
    /// Slices of `columns` × `rows` voxels; the slices before the first are background.
    pub(super) fn new(columns: usize, rows: usize) -> Self {
        let stride = BORDER + 64 * words(columns) + BEHIND;
        let area = stride * (rows + 2 * ROWS);
        Self {
            columns,
            rows,
            stride,
            area,
            slab: vec![0; SLAB * area],
            former: vec![0; SLAB * area],
            begun: 0,
        }
    }

    /// Begins the next slice.
    pub(super) fn begin(&mut self) {
        if self.begun == SLAB {
            std::mem::swap(&mut self.slab, &mut self.former);
            self.begun = 0;
        }
        self.begun += 1;
    }

    /// The current slice and the two before it.
    pub(super) fn three(&mut self) -> Three<'_> {
        let area = self.area;
        let (done, rest) = self.slab.split_at_mut((self.begun - 1) * area);
        let (done, former) = (&*done, &self.former[..]);
        // The decoded slices, in order, lie in two pieces of memory.
        let back = |n: usize| match done.len().checked_sub(n * area) {
            Some(from) => &done[from..from + area],
            None => &former[former.len() + done.len() - n * area..][..area],
        };
        Three { before: [back(1), back(2)], now: &mut rest[..area], stride: self.stride }
    }

    /// The slab's voxels from the first one on, and their distances along x, y and z.
    pub(super) fn slab(&self) -> (&[u32], [usize; 3]) {
        (&self.slab[ROWS * self.stride + BORDER..], [1, self.stride, self.area])
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    pub(super) fn columns(&self) -> usize {
        self.columns
    }
}

impl Three<'_> {
    /// Row `y` of the slice being coded and the rows around it. The row below the last is valid too.
    #[inline]
    pub(super) fn row(&mut self, y: usize) -> (&mut [u32], Around<'_>) {
        let (stride, at) = (self.stride, (y + ROWS) * self.stride);
        let (known, rest) = self.now.split_at_mut(at);
        let known = &*known;
        let [before, before_that] = self.before;
        let around = Around {
            up: &known[at - stride..][..stride],
            up_2: &known[at - 2 * stride..][..stride],
            back: &before[at..][..stride],
            back_up: &before[at - stride..][..stride],
            back_down: &before[at + stride..][..stride],
            back_2: &before_that[at..][..stride],
            slices: [known, before, before_that],
            at,
            stride,
        };
        (&mut rest[..stride], around)
    }
}

impl Around<'_> {
    /// The label at an offset along x, along y and in slices back from voxel `x`. The offset must lead to a decoded voxel or a border.
    #[inline]
    pub(super) fn at(&self, x: usize, [dx, dy, back]: [i8; 3]) -> u32 {
        let row = self.at.wrapping_add_signed(isize::from(dy) * self.stride as isize);
        self.slices[back as usize][(row + BORDER + x).wrapping_add_signed(isize::from(dx))]
    }
}

/// Sets the voxels from `x` to `end` to a label, and up to 15 voxels after them, which later writes replace.
#[inline]
pub(super) fn fill(row: &mut [u32], x: usize, end: usize, label: u32) {
    for at in (x..end).step_by(BEHIND) {
        row[BORDER + at..][..BEHIND].fill(label);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From every slice of a slab, every decoded neighbour and the background outside are at the offsets where they belong.
    #[test]
    fn neighbours_are_where_they_are() {
        let (columns, rows) = (70, 5);
        let label = |x: usize, y: usize, z: usize| (1 + x + 100 * (y + 10 * z)) as u32;
        let mut slices = Slices::new(columns, rows);
        for z in 0..11 {
            slices.begin();
            let mut three = slices.three();
            for y in 0..rows {
                let (row, around) = three.row(y);
                for (step, [x, y, z]) in [
                    ([-7, 0, 1], [3i32, y as i32, z as i32 - 1]),
                    ([8, 3, 1], [18, y as i32 + 3, z as i32 - 1]),
                    ([2, -3, 2], [12, y as i32 - 3, z as i32 - 2]),
                    ([5, -1, 0], [15, y as i32 - 1, z as i32]),
                ] {
                    let is_there = (0..rows as i32).contains(&y) && z >= 0;
                    let expected = if is_there { label(x as usize, y as usize, z as usize) } else { 0 };
                    assert_eq!(around.at(10, step), expected, "{step:?} of row {y} in slice {z}");
                }
                assert_eq!((around.at(0, [-7, 0, 1]), around.at(columns - 1, [8, -1, 0])), (0, 0));
                (0..columns).step_by(7).for_each(|x| fill(row, x, (x + 7).min(columns), 9));
                (0..columns).for_each(|x| row[BORDER + x] = label(x, y, z));
                row[BORDER + columns..].fill(0);
            }
            let (slab, strides) = slices.slab();
            let last = (columns - 1) * strides[0] + (rows - 1) * strides[1] + z % SLAB * strides[2];
            assert_eq!(slab[last], label(columns - 1, rows - 1, z));
        }
    }
}
