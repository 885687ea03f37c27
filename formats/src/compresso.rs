//! Decodes compresso, an encoding of Neuroglancer's precomputed volumes: Matejek et al., *Compresso: Efficient Compression of Segmentation Data For
//! Connectomics* (MICCAI 2017), in the form of the package `compresso` (its README describes the stream; format versions 0 and 1).
//!
//! ```text
//! header      36 bytes: "cpso", version, bytes of a label, u16 × 3 size, u8 × 3 window, u64 ids, u32 values, u64 locations, connectivity 4 or 6
//! ids         the label of each component of voxels that are no boundary, numbered slice by slice in the order of their first voxels
//! values      the bit fields that occur as windows: 1 is a boundary
//! locations   what boundary voxels are that neither their left nor their upper neighbour tells (with connectivity 6: nor that in the slice before)
//! windows     numbers of values, 2 n; or 2 n + 1 for n times value 0
//! (index)     version 1 with connectivity 4: components and locations of each slice, which decoding from the start does not need
//! ```

/// Bytes of the header.
const HEADER: usize = 36;

/// The parts of a stream.
struct Stream {
    sizes: [usize; 3],
    /// Voxels of a window.
    step: [usize; 3],
    is_flat: bool,
    ids: Vec<u64>,
    values: Vec<u64>,
    locations: Vec<u64>,
    windows: Vec<u64>,
}

/// Decodes a chunk to little-endian labels of `id_bytes` bytes, x fastest.
///
/// # Errors
/// Says what contradicts what.
pub(crate) fn decode(data: &[u8], sizes: [u64; 3], id_bytes: usize) -> Result<Vec<u8>, String> {
    let stream = Stream::read(data, sizes, id_bytes)?;
    let boundary = stream.boundary()?;
    let mut labels = stream.components(&boundary)?;
    stream.boundary_labels(&boundary, &mut labels)?;
    Ok(labels.iter().flat_map(|label| label.to_le_bytes().into_iter().take(id_bytes)).collect())
}

impl Stream {
    fn read(data: &[u8], expected: [u64; 3], id_bytes: usize) -> Result<Self, String> {
        let head: &[u8; HEADER] = data.first_chunk().ok_or("the stream is shorter than its header")?;
        if !head.starts_with(b"cpso") {
            return Err("the stream does not begin with cpso".into());
        }
        let number = |at: usize, bytes: usize| {
            head[at..at + bytes].iter().rev().fold(0u64, |n, &byte| n << 8 | u64::from(byte))
        };
        let (version, width) = (head[4], usize::from(head[5]));
        if version > 1 {
            return Err(format!("expected version 0 or 1 of the format, got {version}"));
        }
        if width != id_bytes {
            return Err(format!("expected labels of {id_bytes} bytes, got {width}"));
        }
        let sizes = [6, 8, 10].map(|at| number(at, 2));
        if sizes != expected {
            return Err(format!("expected {expected:?} voxels, got {sizes:?}"));
        }
        let step = [12, 13, 14].map(|at| usize::from(head[at]));
        let bits: usize = step.iter().product();
        let window = [8, 16, 32, 64].into_iter().find(|&most| bits <= most && bits > 0);
        let window = window.ok_or_else(|| format!("expected windows of 1 to 64 voxels, got {step:?}"))? / 8;
        let is_flat = match head[35] {
            4 => true,
            6 => false,
            other => return Err(format!("expected connectivity 4 or 6, got {other}")),
        };
        let mut rest = &data[HEADER..];
        let mut list = |count: u64, bytes: usize, what: &str| -> Result<Vec<u64>, String> {
            let length = usize::try_from(count).ok().and_then(|count| count.checked_mul(bytes));
            let split = length.and_then(|length| rest.split_at_checked(length));
            let (mine, after) = split.ok_or_else(|| format!("{count} {what} reach beyond the stream"))?;
            rest = after;
            Ok(numbers(mine, bytes))
        };
        let ids = list(number(15, 8), width, "ids")?;
        let values = list(number(23, 4), window, "values")?;
        let locations = list(number(27, 8), width, "locations")?;
        let sizes = sizes.map(|size| size as usize);
        let index = if version == 1 && is_flat { 2 * sizes[2] * index_bytes(sizes) } else { 0 };
        let windows = rest.len().checked_sub(index).ok_or("the index of slices reaches beyond the stream")?;
        Ok(Self { sizes, step, is_flat, ids, values, locations, windows: numbers(&rest[..windows], window) })
    }

    /// Whether each voxel is a boundary.
    fn boundary(&self) -> Result<Vec<bool>, String> {
        let grid = [0, 1, 2].map(|a| self.sizes[a].div_ceil(self.step[a]));
        let count = grid.iter().product::<usize>();
        let mut fields = Vec::with_capacity(count);
        for &coded in &self.windows {
            let (value, times) = if coded & 1 == 0 { (coded >> 1, 1) } else { (0, coded >> 1) };
            let value = usize::try_from(value).ok().and_then(|value| self.values.get(value));
            let &value = value.ok_or_else(|| {
                format!("a window has value {}, and there are {}", coded >> 1, self.values.len())
            })?;
            if times > (count - fields.len()) as u64 {
                return Err(format!("the stream has more than {count} windows"));
            }
            fields.resize(fields.len() + times as usize, value);
        }
        if fields.len() != count {
            return Err(format!("expected {count} windows, got {}", fields.len()));
        }
        let mut boundary = Vec::with_capacity(self.sizes.iter().product());
        for z in 0..self.sizes[2] {
            for y in 0..self.sizes[1] {
                for x in 0..self.sizes[0] {
                    let [wx, wy, wz] = [x / self.step[0], y / self.step[1], z / self.step[2]];
                    let field = fields[wx + grid[0] * (wy + grid[1] * wz)];
                    let bit = x % self.step[0]
                        + self.step[0] * (y % self.step[1] + self.step[1] * (z % self.step[2]));
                    boundary.push(field >> bit & 1 != 0);
                }
            }
        }
        Ok(boundary)
    }

    /// Labels of the voxels that are no boundary: each component has one. The others are 0.
    fn components(&self, boundary: &[bool]) -> Result<Vec<u64>, String> {
        let mut labels = vec![0; boundary.len()];
        let mut seen = boundary.to_vec();
        let mut next = 0;
        let mut open = Vec::new();
        for first in 0..boundary.len() {
            if seen[first] {
                continue;
            }
            let &label =
                self.ids.get(next).ok_or_else(|| format!("there are more components than the {next} ids"))?;
            next += 1;
            seen[first] = true;
            open.push(first);
            while let Some(at) = open.pop() {
                labels[at] = label;
                for neighbour in self.neighbours(at, if self.is_flat { 2 } else { 3 }).into_iter().flatten() {
                    if !std::mem::replace(&mut seen[neighbour], true) {
                        open.push(neighbour);
                    }
                }
            }
        }
        Ok(labels)
    }

    /// The voxels beside one along the first `axes` axes: below and above along x, then y, then z; `None` beyond the chunk.
    fn neighbours(&self, at: usize, axes: usize) -> [Option<usize>; 6] {
        let strides = [1, self.sizes[0], self.sizes[0] * self.sizes[1]];
        std::array::from_fn(|n| {
            let (a, is_above) = (n / 2, n % 2 == 1);
            let index = at / strides[a] % self.sizes[a];
            match is_above {
                _ if a >= axes => None,
                true => (index + 1 < self.sizes[a]).then(|| at + strides[a]),
                false => (index > 0).then(|| at - strides[a]),
            }
        })
    }

    /// Labels of boundary voxels: that of the left or the upper neighbour which is none, else what the next location says: a neighbour, or the
    /// label, 7 higher, or as the number after a 6 where that is too large.
    fn boundary_labels(&self, boundary: &[bool], labels: &mut [u64]) -> Result<(), String> {
        let mut locations = self.locations.iter().copied();
        for at in (0..boundary.len()).filter(|&at| boundary[at]) {
            let beside = self.neighbours(at, 3);
            // Where components reach through slices, the neighbour in the slice before tells it too.
            let before = beside[4].filter(|_| !self.is_flat);
            let tells = [beside[0], beside[2], before].into_iter().flatten().find(|&n| !boundary[n]);
            if let Some(inner) = tells {
                labels[at] = labels[inner];
                continue;
            }
            let short = || "there are fewer locations than boundary voxels that need one".to_owned();
            labels[at] = match locations.next().ok_or_else(short)? {
                code @ 0..6 => {
                    let from = beside[code as usize].ok_or("a location names a voxel beyond the chunk")?;
                    labels[from]
                }
                6 => locations.next().ok_or_else(short)?,
                label => label - 7,
            };
        }
        Ok(())
    }
}

/// Bytes of a number of the index: the fewest that count the voxels of two slices.
fn index_bytes(sizes: [usize; 3]) -> usize {
    match 2 * sizes[0] * sizes[1] {
        0..=0xFF => 1,
        0x100..=0xFFFF => 2,
        0x1_0000..=0xFFFF_FFFF => 4,
        _ => 8,
    }
}

fn numbers(bytes: &[u8], width: usize) -> Vec<u64> {
    bytes
        .chunks_exact(width)
        .map(|number| number.iter().rev().fold(0, |n, &byte| n << 8 | u64::from(byte)))
        .collect()
}
