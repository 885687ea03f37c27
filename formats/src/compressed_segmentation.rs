//! Decodes Neuroglancer's `compressed_segmentation` (`src/sliceview/compressed_segmentation/README.md` in its repository).
//!
//! ```text
//! u32 × channels     offset of each channel, in words of 32 bits
//! u64 × blocks       24 bits table offset, 8 bits width, 32 bits values offset; blocks of 8 × 8 × 8 voxels, x fastest; offsets from the channel's start
//! values             an index of `width` bits a voxel, lowest bits first, x fastest
//! tables             ids of 32 or 64 bits
//! ```

/// Decodes all channels to little-endian labels of `id_bytes` bytes, x fastest, then y, z, channel.
///
/// # Errors
/// Says what reaches beyond the data.
pub(crate) fn decode(
    data: &[u8],
    sizes: [u64; 3],
    channels: u64,
    block: [u64; 3],
    id_bytes: usize,
) -> Result<Vec<u8>, String> {
    if !data.len().is_multiple_of(4) {
        return Err(format!("expected words of 4 bytes, got {} bytes", data.len()));
    }
    let (words, _) = data.as_chunks::<4>();
    let word = |at: usize| words.get(at).map(|&w| u32::from_le_bytes(w));
    let voxels = sizes.iter().product::<u64>() as usize;
    let mut labels = vec![0; voxels * channels as usize * id_bytes];
    for (channel, target) in labels.chunks_exact_mut(voxels * id_bytes).enumerate() {
        let start = word(channel).ok_or("the offset of a channel is missing")? as usize;
        let of_channel =
            words.get(start..).ok_or_else(|| format!("channel {channel} begins beyond the data"))?;
        decode_channel(of_channel, sizes, block, id_bytes, target)?;
    }
    Ok(labels)
}

fn decode_channel(
    words: &[[u8; 4]],
    sizes: [u64; 3],
    block: [u64; 3],
    id_bytes: usize,
    target: &mut [u8],
) -> Result<(), String> {
    let word = |at: usize| words.get(at).map(|&w| u32::from_le_bytes(w));
    let blocks = [0, 1, 2].map(|a| sizes[a].div_ceil(block[a]) as usize);
    let [sx, sy, sz] = sizes.map(|s| s as usize);
    let [bx, by, bz] = block.map(|b| b as usize);
    for number in 0..blocks.iter().product() {
        let beyond = |what: &str| format!("block {number}: {what} beyond the data");
        let (low, values) = (word(2 * number), word(2 * number + 1));
        let (Some(low), Some(values)) = (low, values) else { return Err(beyond("its header is")) };
        let (table, bits) = ((low & 0x00FF_FFFF) as usize, low >> 24);
        if !matches!(bits, 0 | 1 | 2 | 4 | 8 | 16 | 32) {
            return Err(format!(
                "block {number}: expected 0, 1, 2, 4, 8, 16 or 32 bits an index, got {bits}"
            ));
        }
        let mask = if bits == 32 { u32::MAX } else { (1 << bits) - 1 };
        let corner = [
            number % blocks[0] * bx,
            number / blocks[0] % blocks[1] * by,
            number / blocks[0] / blocks[1] * bz,
        ];
        for z in corner[2]..(corner[2] + bz).min(sz) {
            for y in corner[1]..(corner[1] + by).min(sy) {
                let row = bx * ((y - corner[1]) + by * (z - corner[2]));
                for x in corner[0]..(corner[0] + bx).min(sx) {
                    let index = if bits == 0 {
                        0
                    } else {
                        let at = (row + x - corner[0]) * bits as usize;
                        let value = word(values as usize + at / 32).ok_or_else(|| beyond("an index is"))?;
                        (value >> (at % 32) & mask) as usize
                    };
                    let at = table + index * (id_bytes / 4);
                    let id =
                        words.get(at..at + id_bytes / 4).ok_or_else(|| beyond("an id is"))?.as_flattened();
                    let to = (x + sx * (y + sy * z)) * id_bytes;
                    target[to..to + id_bytes].copy_from_slice(id);
                }
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(words: &[u32]) -> Vec<u8> {
        words.iter().flat_map(|w| w.to_le_bytes()).collect()
    }

    /// Two blocks of 2 × 2 × 1 voxels: one with two ids, one with a single id, which needs no indices.
    #[test]
    fn indices_and_tables() {
        let data = words(&[1, 5 | 1 << 24, 4, 7, 0, 0b0110, 30, 40, 50]);
        let got = decode(&data, [3, 2, 1], 1, [2, 2, 1], 4).unwrap();
        assert_eq!(got, words(&[30, 40, 50, 40, 30, 50]));
        for cut in (0..data.len()).step_by(4) {
            assert!(decode(&data[..cut], [3, 2, 1], 1, [2, 2, 1], 4).is_err(), "{cut}");
        }
        assert!(decode(&words(&[1, 5 | 3 << 24, 4, 7, 0, 6, 3, 4, 5]), [3, 2, 1], 1, [2, 2, 1], 4).is_err());
    }
}
