//! Large allocations, whose size comes from a file, a flag or a scene: where memory is short, they are an error and not the end of the
//! process.
//!
//! ```text
//! check_room         compares with what the system has left    Linux grants more than it has, and then ends the process
//! reserved, zeroed,  ask the allocator                         limits of the process, and systems that grant only what they have
//! collected,
//! collected_by_threads,
//! make_room, make_room_in_map,
//! sort_by_key, sort_by_group,
//! sorted_by_group
//! ```

use std::collections::HashMap;
use std::hash::{BuildHasher, Hash};
use std::ops::Range;
use std::path::Path;

use bytemuck::Zeroable;
use rayon::prelude::*;

use crate::memory::available_bytes;

/// Memory is short; the text is one line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoMemory {
    /// More is needed than the system has left.
    #[error("{what} needs {} of memory, {} are free", size_text(*needed_bytes), size_text(*free_bytes))]
    Short {
        /// What needs the memory.
        what: String,
        /// Bytes that it needs at least.
        needed_bytes: u64,
        /// Bytes that were free.
        free_bytes: u64,
    },
    /// The allocator refused.
    #[error("{what} needs {} of memory, which the system refuses", size_text(*needed_bytes))]
    Refused {
        /// What needs the memory.
        what: String,
        /// Bytes that were asked for.
        needed_bytes: u64,
    },
}

impl NoMemory {
    /// The same with the file that asks for the memory, at the beginning of the line.
    #[must_use]
    pub fn of_file(mut self, path: &Path) -> Self {
        let (Self::Short { what, .. } | Self::Refused { what, .. }) = &mut self;
        *what = format!("{}: {what}", path.display());
        self
    }
}

/// Allocations below this many bytes are not compared with what the system has left: asking takes some 0.1 ms.
const WORTH_ASKING_BYTES: u64 = 64 << 20;

/// Checks that `needed_bytes` are free, where the system says how much is.
///
/// # Errors
/// [`NoMemory::Short`].
pub fn check_room(what: &str, needed_bytes: u64) -> Result<(), NoMemory> {
    if needed_bytes < WORTH_ASKING_BYTES {
        return Ok(());
    }
    match available_bytes() {
        Some(free_bytes) if free_bytes < needed_bytes => {
            Err(NoMemory::Short { what: what.to_owned(), needed_bytes, free_bytes })
        }
        _ => Ok(()),
    }
}

/// Bytes of `count` elements.
fn bytes_of<T>(count: usize) -> u64 {
    (count as u64).saturating_mul(size_of::<T>() as u64)
}

/// An empty list with room for exactly `count` elements.
///
/// # Errors
/// [`NoMemory`] says what needs how much.
pub fn reserved<T>(count: usize, what: &str) -> Result<Vec<T>, NoMemory> {
    let needed_bytes = bytes_of::<T>(count);
    check_room(what, needed_bytes)?;
    let mut list = Vec::new();
    list.try_reserve_exact(count).map_err(|_| NoMemory::Refused { what: what.to_owned(), needed_bytes })?;
    Ok(list)
}

/// A list of `count` zeroes. As with `vec![0; count]`, the system provides its pages when they are first used.
///
/// # Errors
/// As [`reserved`].
pub fn zeroed<T: Zeroable>(count: usize, what: &str) -> Result<Vec<T>, NoMemory> {
    let needed_bytes = bytes_of::<T>(count);
    check_room(what, needed_bytes)?;
    bytemuck::allocation::try_zeroed_vec(count)
        .map_err(|()| NoMemory::Refused { what: what.to_owned(), needed_bytes })
}

/// What an iterator gives, in a list with room for exactly `count` elements; `count` is how many it gives.
///
/// # Errors
/// As [`reserved`].
pub fn collected<T>(
    count: usize,
    items: impl IntoIterator<Item = T>,
    what: &str,
) -> Result<Vec<T>, NoMemory> {
    let mut list = reserved(count, what)?;
    list.extend(items);
    Ok(list)
}

/// As [`collected`], by all threads.
///
/// # Errors
/// As [`reserved`].
pub fn collected_by_threads<T: Send>(
    items: impl IndexedParallelIterator<Item = T>,
    what: &str,
) -> Result<Vec<T>, NoMemory> {
    let mut list = reserved(items.len(), what)?;
    items.collect_into_vec(&mut list);
    Ok(list)
}

/// Makes room at the end of a list whose length nobody knows beforehand, for `more` elements. A full list doubles its room, as with
/// [`Vec::reserve`].
///
/// # Errors
/// As [`reserved`], with what the list needs with its new room; the list stays as it is.
pub fn make_room<T>(list: &mut Vec<T>, more: usize, what: &str) -> Result<(), NoMemory> {
    if list.capacity() - list.len() >= more {
        return Ok(());
    }
    let room = list.len().saturating_add(more).max(list.capacity().saturating_mul(2));
    let needed_bytes = bytes_of::<T>(room);
    check_room(what, needed_bytes)?;
    list.try_reserve_exact(room - list.len())
        .map_err(|_| NoMemory::Refused { what: what.to_owned(), needed_bytes })
}

/// Makes room in a map for one more entry. A full map doubles its room.
///
/// # Errors
/// As [`reserved`], with what the entries need with the new room; the map stays as it is.
pub fn make_room_in_map<K: Eq + Hash, V, S: BuildHasher>(
    map: &mut HashMap<K, V, S>,
    what: &str,
) -> Result<(), NoMemory> {
    if map.len() < map.capacity() {
        return Ok(());
    }
    // A byte an entry says whether its place is taken.
    let needed_bytes = (bytes_of::<(K, V)>(2 * map.len())).saturating_add(2 * map.len() as u64);
    check_room(what, needed_bytes)?;
    map.try_reserve(1).map_err(|_| NoMemory::Refused { what: what.to_owned(), needed_bytes })
}

/// Sorts by a key; elements with equal keys keep their order. The standard library's stable sort allocates and aborts where it is refused.
///
/// # Errors
/// As [`reserved`], for a key and a place an element; the list stays as it is.
pub fn sort_by_key<T, K: Ord>(list: &mut [T], key: impl Fn(&T) -> K, what: &str) -> Result<(), NoMemory> {
    if list.is_sorted_by_key(&key) {
        return Ok(());
    }
    let mut order = collected(list.len(), list.iter().map(&key).zip(0usize..), what)?;
    order.sort_unstable();
    permute(list, |to| std::mem::replace(&mut order[to].1, to));
    Ok(())
}

/// Sorts by a group, a number below `group_count`, and gives each group's places in the sorted list; elements of a group keep their order.
/// It counts where [`sort_by_key`] compares: sooner, and with half of the memory, where there are far fewer groups than elements.
///
/// # Errors
/// As [`reserved`], for eight bytes an element; the list stays as it is.
///
/// # Panics
/// If the list has 2³² elements or more, or an element's group is `group_count` or more.
pub fn sort_by_group<T>(
    list: &mut [T],
    group_count: usize,
    group: impl Fn(&T) -> usize,
    what: &str,
) -> Result<Vec<Range<u32>>, NoMemory> {
    assert!(list.len() <= u32::MAX as usize, "fewer than 2³² elements");
    let places = collected(list.len(), 0..list.len() as u32, what)?;
    let (mut order, groups) =
        sorted_by_group(places, group_count, |&place| group(&list[place as usize]), what)?;
    permute(list, |to| std::mem::replace(&mut order[to], to as u32) as usize);
    Ok(groups)
}

/// As [`sort_by_group`], for elements that can be copied. It returns a second list, and gives the memory of the first back as it fills the
/// second, where the system takes back the end of an allocation: then both need little more than one.
///
/// # Errors
/// As [`reserved`], for another list of that length.
///
/// # Panics
/// As [`sort_by_group`].
pub fn sorted_by_group<T: Copy + Zeroable>(
    mut list: Vec<T>,
    group_count: usize,
    group: impl Fn(&T) -> usize,
    what: &str,
) -> Result<(Vec<T>, Vec<Range<u32>>), NoMemory> {
    assert!(list.len() <= u32::MAX as usize, "fewer than 2³² elements");
    let mut ends: Vec<u32> = zeroed(group_count, what)?;
    list.iter().for_each(|element| ends[group(element)] += 1);
    let mut groups = reserved(group_count, what)?;
    let mut start = 0;
    for end in &mut ends {
        groups.push(start..start + *end);
        start += *end;
        *end = start;
    }
    if list.is_sorted_by_key(&group) {
        return Ok((list, groups));
    }
    let mut sorted: Vec<T> = zeroed(list.len(), what)?;
    // From the end, so that what was copied can be given back.
    while let Some(first) = list.len().checked_sub(1).map(|last| last / GIVEN_BACK * GIVEN_BACK) {
        for element in list.drain(first..).rev() {
            let end = &mut ends[group(&element)];
            *end -= 1;
            sorted[*end as usize] = element;
        }
        list.shrink_to_fit();
    }
    Ok((sorted, groups))
}

/// Elements whose memory [`sorted_by_group`] gives back at a time: often enough to matter, and seldom enough to cost nothing.
const GIVEN_BACK: usize = 1 << 18;

/// Moves each element to its place. `take(to)` gives the place whose element belongs to the place `to`, and `to` when it is asked again.
fn permute<T>(list: &mut [T], mut take: impl FnMut(usize) -> usize) {
    // Each cycle of the permutation is followed once; a place that has its element refers to itself.
    for start in 0..list.len() {
        let mut to = start;
        loop {
            let from = take(to);
            if from == start {
                break;
            }
            list.swap(to, from);
            to = from;
        }
    }
}

/// A number of bytes for people: `812 B`, `6.3 MB`, `54.1 GB`, in powers of 1000.
pub fn size_text(bytes: u64) -> String {
    let (mut value, mut unit) = (bytes as f64, "B");
    for larger in ["kB", "MB", "GB", "TB", "PB", "EB"] {
        // What would be rounded to 1000 belongs to the next unit.
        if value < 999.95 {
            break;
        }
        (value, unit) = (value / 1000.0, larger);
    }
    if unit == "B" { format!("{bytes} B") } else { format!("{value:.1} {unit}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fits_is_given() {
        let list: Vec<u64> = reserved(1000, "a list").unwrap();
        assert!(list.is_empty() && list.capacity() >= 1000);
        assert_eq!(zeroed::<f32>(1000, "a film").unwrap(), vec![0.0; 1000]);
        assert_eq!(zeroed::<f32>(0, "nothing").unwrap(), Vec::<f32>::new());
    }

    #[test]
    fn a_list_that_grows_doubles_and_keeps_what_it_has() {
        let mut list: Vec<u32> = Vec::new();
        let mut rooms = std::collections::BTreeSet::new();
        for number in 0..1000 {
            make_room(&mut list, 1, "a list").unwrap();
            assert!(list.capacity() > list.len());
            rooms.insert(list.capacity());
            list.push(number);
        }
        assert!(list.iter().copied().eq(0..1000) && rooms.len() <= 11, "{rooms:?}");
        make_room(&mut list, 5000, "a list").unwrap();
        assert!(list.capacity() >= 6000 && list.len() == 1000);
    }

    #[test]
    fn what_is_collected_is_what_was_given() {
        assert_eq!(collected(3, [5, 6, 7], "a list").unwrap(), [5, 6, 7]);
        let squares = collected_by_threads((0..5000u32).into_par_iter().map(|i| i * i), "a list").unwrap();
        assert!(squares.len() == 5000 && squares.iter().zip(0..).all(|(&square, i)| square == i * i));
    }

    #[test]
    fn a_map_that_grows_keeps_what_it_has() {
        let mut map = HashMap::new();
        let mut rooms = std::collections::BTreeSet::new();
        for number in 0..1000u32 {
            make_room_in_map(&mut map, "a map").unwrap();
            rooms.insert(map.capacity());
            assert!(map.capacity() > map.len());
            map.insert(number, 2 * number);
        }
        assert!((0..1000).all(|n| map[&n] == 2 * n) && rooms.len() <= 12, "{rooms:?}");
    }

    #[test]
    fn a_sorted_list_keeps_the_order_of_equal_keys() {
        let mut random = 1u64;
        for length in [0, 1, 2, 3, 10, 1000] {
            for keys in [1, 2, 7, 1 << 40] {
                let mut list: Vec<(u64, usize)> = (0..length)
                    .map(|place| {
                        random =
                            random.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
                        ((random >> 20) % keys, place)
                    })
                    .collect();
                let mut expected = list.clone();
                expected.sort_by_key(|&(key, _)| key);
                sort_by_key(&mut list, |&(key, _)| key, "a list").unwrap();
                assert_eq!(list, expected, "{length} elements with {keys} keys");
            }
        }
    }

    #[test]
    fn a_list_sorted_by_group_keeps_the_order_within_a_group() {
        let mut random = 1u64;
        for length in [0, 1, 2, 3, 10, 1000, GIVEN_BACK, 2 * GIVEN_BACK + 5] {
            for group_count in [1, 2, 7, 3000] {
                let mut list: Vec<(usize, usize)> = (0..length)
                    .map(|place| {
                        random =
                            random.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
                        ((random >> 20) as usize % group_count, place)
                    })
                    .collect();
                let mut expected = list.clone();
                expected.sort_by_key(|&(group, _)| group);
                let (copied, groups) =
                    sorted_by_group(list.clone(), group_count, |&(group, _)| group, "a list").unwrap();
                assert!(copied == expected, "{length} elements of {group_count} groups");
                let same = sort_by_group(&mut list, group_count, |&(group, _)| group, "a list").unwrap();
                assert!(list == expected && same == groups, "{length} elements of {group_count} groups");
                assert_eq!(groups.len(), group_count);
                let mut start = 0;
                for (group, places) in groups.into_iter().enumerate() {
                    assert_eq!(places.start, start);
                    start = places.end;
                    assert!(list[places.start as usize..places.end as usize].iter().all(|e| e.0 == group));
                }
                assert_eq!(start as usize, length);
            }
        }
    }

    #[test]
    fn what_no_machine_has_is_an_error_that_says_how_much() {
        // 2⁵⁹ bytes: more than any machine has, less than what an allocator's interface can express.
        for error in [
            reserved::<u64>(1 << 56, "a list").unwrap_err(),
            zeroed::<u64>(1 << 56, "a list").unwrap_err(),
            collected(1 << 56, [7u64], "a list").unwrap_err(),
            check_room("a list", 1 << 59).unwrap_err(),
        ] {
            let text = error.to_string();
            assert!(text.starts_with("a list needs 576.5 PB of memory, "), "{text}");
            assert!(!text.contains('\n'), "{text}");
        }
        let mut list = vec![7u64; 3];
        let grown = make_room(&mut list, 1 << 56, "a list").unwrap_err().to_string();
        assert!(grown.starts_with("a list needs 576.5 PB of memory, ") && list == [7; 3], "{grown}");
        let beyond = reserved::<u64>(usize::MAX, "a list").unwrap_err();
        assert!(beyond.to_string().starts_with("a list needs 18.4 EB of memory"), "{beyond}");
    }

    #[test]
    fn sizes_have_one_digit_and_the_unit_in_which_they_are_short() {
        let cases = [
            (0, "0 B"),
            (812, "812 B"),
            (999, "999 B"),
            (1000, "1.0 kB"),
            (999_940, "999.9 kB"),
            (999_960, "1.0 MB"),
            (54_100_000_000, "54.1 GB"),
            (u64::MAX, "18.4 EB"),
        ];
        for (bytes, expected) in cases {
            assert_eq!(size_text(bytes), expected);
        }
    }
}
