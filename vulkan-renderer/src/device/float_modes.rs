//! Floating-point execution modes of shaders, as far as the device supports them.
//!
//! Vulkan leaves three things to the driver: whether sums round to even, whether it may assume that no number is infinite or NaN, and
//! whether denormal doubles are kept. All drivers of graphics cards behave as a CPU does when they are asked to, so shaders ask. A device
//! without these modes still computes, but its hits may differ in the last bits.
//!
//! ```text
//! header │ OpCapability M │ capabilities … │ OpEntryPoint │ OpExecutionMode entry M width │ the rest, as it was
//!          ▲ inserted for each mode                          ▲ inserted for each mode and width
//! ```
//! The words are inserted when the module is created: the checked-in modules are the same for every device, and a module must not declare a
//! mode that the device does not have. Modes and numbers: the SPIR-V specification 1.5, sections 3.6 and 3.31.

use std::borrow::Cow;

use ash::vk;

const OP_ENTRY_POINT: u32 = 15;
const OP_EXECUTION_MODE: u32 = 16;
const OP_CAPABILITY: u32 = 17;
const CAPABILITY_FLOAT64: u32 = 10;
const HEADER_WORDS: usize = 5;

/// An execution mode: its number, and the capability that it needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Mode {
    capability: u32,
    number: u32,
}

const DENORM_PRESERVE: Mode = Mode { capability: 4464, number: 4459 };
const SIGNED_ZERO_INF_NAN_PRESERVE: Mode = Mode { capability: 4466, number: 4461 };
const ROUNDING_MODE_RTE: Mode = Mode { capability: 4467, number: 4462 };

/// The modes of a device, each with the width of floats it applies to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct FloatModes {
    /// For modules that use doubles.
    with_doubles: Vec<(Mode, u32)>,
    /// For modules without doubles.
    without: Vec<(Mode, u32)>,
}

impl FloatModes {
    /// Queries the device for its modes.
    pub(super) fn of(calls: &ash::Instance, physical: vk::PhysicalDevice) -> Self {
        let mut floats = vk::PhysicalDeviceFloatControlsProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut floats);
        // SAFETY: the device is of this instance and of version 1.2, whose structure this is.
        unsafe { calls.get_physical_device_properties2(physical, &mut properties) };
        Self::new(&floats)
    }

    fn new(p: &vk::PhysicalDeviceFloatControlsProperties<'_>) -> Self {
        use vk::ShaderFloatControlsIndependence as Independence;
        let is = |b: vk::Bool32| b != 0;
        let zeros =
            [p.shader_signed_zero_inf_nan_preserve_float32, p.shader_signed_zero_inf_nan_preserve_float64];
        let even = [p.shader_rounding_mode_rte_float32, p.shader_rounding_mode_rte_float64].map(is);
        let tied = p.rounding_mode_independence == Independence::NONE;
        let denorms_apart = p.denorm_behavior_independence != Independence::NONE;
        let mut modes = Self::default();
        for (list, doubles) in [(&mut modes.with_doubles, true), (&mut modes.without, false)] {
            for (width, has) in [(32, zeros[0]), (64, zeros[1])] {
                if is(has) && (width == 32 || doubles) {
                    list.push((SIGNED_ZERO_INF_NAN_PRESERVE, width));
                }
            }
            // Where rounding modes of the widths are not independent, both must be set.
            let both = even[0] && even[1];
            for (width, has) in [(32, even[0]), (64, even[1])] {
                let may = if tied && doubles { both } else { has };
                if may && (width == 32 || doubles) {
                    list.push((ROUNDING_MODE_RTE, width));
                }
            }
            // Set for doubles alone: exact hits depend on them, and keeping denormals of 32-bit floats costs time on some cards.
            if doubles && denorms_apart && is(p.shader_denorm_preserve_float64) {
                list.push((DENORM_PRESERVE, 64));
            }
        }
        modes
    }

    /// The module with the modes declared; unchanged where there are none or where it is not a valid module.
    pub(super) fn declared_in<'a>(&self, words: &'a [u32]) -> Cow<'a, [u32]> {
        let Some((end, entries, doubles)) = outline(words) else { return Cow::Borrowed(words) };
        let modes = if doubles { &self.with_doubles } else { &self.without };
        if modes.is_empty() {
            return Cow::Borrowed(words);
        }
        let mut capabilities: Vec<u32> = modes.iter().map(|(mode, _)| mode.capability).collect();
        capabilities.sort_unstable();
        capabilities.dedup();
        let mut declared = Vec::with_capacity(words.len() + 8 * capabilities.len());
        declared.extend_from_slice(&words[..HEADER_WORDS]);
        declared.extend(capabilities.iter().flat_map(|c| [2 << 16 | OP_CAPABILITY, *c]));
        declared.extend_from_slice(&words[HEADER_WORDS..end]);
        for entry in entries {
            let lines =
                modes.iter().map(|(mode, width)| [4 << 16 | OP_EXECUTION_MODE, entry, mode.number, *width]);
            declared.extend(lines.flatten());
        }
        declared.extend_from_slice(&words[end..]);
        Cow::Owned(declared)
    }
}

/// The word after the last entry point, the ids of all entry points, and whether the module uses doubles.
fn outline(words: &[u32]) -> Option<(usize, Vec<u32>, bool)> {
    let (mut at, mut end, mut entries, mut doubles) = (HEADER_WORDS, 0, Vec::new(), false);
    while let Some(&first) = words.get(at) {
        let length = (first >> 16) as usize;
        let line = words.get(at..at + length).filter(|line| !line.is_empty())?;
        at += length;
        match (first & 0xFFFF, line) {
            (OP_CAPABILITY, [_, capability]) => doubles |= *capability == CAPABILITY_FLOAT64,
            (OP_ENTRY_POINT, [_, _, entry, ..]) => {
                entries.push(*entry);
                end = at;
            }
            // Entry points are contiguous; nothing after them is needed.
            _ if end > 0 => break,
            _ => {}
        }
    }
    (end > 0).then_some((end, entries, doubles))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn properties(bits: [bool; 5]) -> vk::PhysicalDeviceFloatControlsProperties<'static> {
        let [zeros32, zeros64, even32, even64, denorms64] = bits;
        vk::PhysicalDeviceFloatControlsProperties::default()
            .shader_signed_zero_inf_nan_preserve_float32(zeros32)
            .shader_signed_zero_inf_nan_preserve_float64(zeros64)
            .shader_rounding_mode_rte_float32(even32)
            .shader_rounding_mode_rte_float64(even64)
            .shader_denorm_preserve_float64(denorms64)
            .rounding_mode_independence(vk::ShaderFloatControlsIndependence::ALL)
            .denorm_behavior_independence(vk::ShaderFloatControlsIndependence::ALL)
    }

    #[test]
    fn only_what_the_device_has_is_asked_for() {
        assert_eq!(FloatModes::new(&properties([false; 5])), FloatModes::default());
        let all = FloatModes::new(&properties([true; 5]));
        assert_eq!(all.without, [(SIGNED_ZERO_INF_NAN_PRESERVE, 32), (ROUNDING_MODE_RTE, 32)]);
        assert_eq!(all.with_doubles.len(), 5);
        // The device supports a mode for one width alone but requires the same for both, so modules with doubles set neither.
        let tied = properties([false, false, true, false, true])
            .rounding_mode_independence(vk::ShaderFloatControlsIndependence::NONE)
            .denorm_behavior_independence(vk::ShaderFloatControlsIndependence::NONE);
        let tied = FloatModes::new(&tied);
        assert_eq!((tied.with_doubles, tied.without), (vec![], vec![(ROUNDING_MODE_RTE, 32)]));
    }

    /// A minimal module, written by hand.
    #[test]
    fn lines_stand_where_the_language_wants_them() {
        let header = [0x0723_0203, 0x0001_0500, 0, 9, 0];
        let shader = [2 << 16 | OP_CAPABILITY, 1];
        let float64 = [2 << 16 | OP_CAPABILITY, CAPABILITY_FLOAT64];
        let entry = [4 << 16 | OP_ENTRY_POINT, 5, 7, 0x6E_69_61];
        let size = [6 << 16 | OP_EXECUTION_MODE, 7, 17, 8, 8, 1];
        let modes = FloatModes::new(&properties([true, true, false, false, false]));
        let capability = [2 << 16 | OP_CAPABILITY, 4466];
        let mode = |width| [4 << 16 | OP_EXECUTION_MODE, 7, 4461, width];
        let without = [&header[..], &shader, &entry, &size].concat();
        let expected = [&header[..], &capability, &shader, &entry, &mode(32), &size].concat();
        assert_eq!(*modes.declared_in(&without), expected);
        let with = [&header[..], &shader, &float64, &entry, &size].concat();
        let expected =
            [&header[..], &capability, &shader, &float64, &entry, &mode(32), &mode(64), &size].concat();
        assert_eq!(*modes.declared_in(&with), expected);
        // An invalid module stays unchanged, so that the driver is the one that refuses it.
        for broken in [&[][..], &header, &without[..9], &[&header[..], &[0, 0]].concat()] {
            assert_eq!(*modes.declared_in(broken), *broken);
        }
    }
}
