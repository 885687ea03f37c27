//! Turns the name of a backend into the ways to render (backend and device), in the order in which they are tried.
//!
//! ```text
//! auto                    every graphics processor × the backends that it supports, in its order (`Card::backends`), then cpu
//! cpu                     our own path tracer; Vulkan is not started
//! vulkan-rt               the best device that supports it, drivers that compute on the CPU last
//! vulkan-rt:1             the device with that number in `pumice devices`
//! vulkan-rt:radeon        the device whose name contains this text
//! ```
//! A named backend is tried alone, and its failure is an error. Only `auto` falls back to other backends.

use pumice_vulkan::device::Backend;

use super::card::Card;
use crate::error::{Result, SessionError};

/// One way to render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    Cpu,
    Vulkan { number: usize, backend: Backend },
}

/// The ways that a name stands for, in the order of trial; never empty. `cards` is called only for names that involve Vulkan.
pub(super) fn choose(
    name: &str,
    cards: impl FnOnce() -> std::result::Result<Vec<Card>, String>,
) -> Result<Vec<Way>> {
    let wrong = |what: String| SessionError::Caller(format!("backend {name}: {what}"));
    match name {
        "cpu" => return Ok(vec![Way::Cpu]),
        "auto" => return Ok(automatic(&cards().unwrap_or_default())),
        _ => {}
    }
    let (backend, device) = name.split_once(':').map_or((name, None), |(b, d)| (b, Some(d.trim())));
    let backend = Backend::from_name(backend).ok_or_else(|| {
        wrong(
            "no such backend; expected auto, cpu, vulkan-rt, vulkan-query or vulkan-compute, the last three also with a \
             device's number or a part of its name: vulkan-rt:0"
                .into(),
        )
    })?;
    let cards = cards().map_err(wrong)?;
    if cards.is_empty() {
        return Err(wrong("Vulkan finds no device here".into()));
    }
    let number = match device {
        Some(device) => {
            let number = numbered(&cards, device).map_err(wrong)?;
            if !cards[number].can(backend) {
                return Err(wrong(lacks(number, &cards[number], backend)));
            }
            number
        }
        None => cards.iter().position(|c| c.can(backend)).ok_or_else(|| {
            let each: Vec<_> = cards.iter().enumerate().map(|(i, c)| lacks(i, c, backend)).collect();
            wrong(format!("no device here supports it: {}", each.join("; ")))
        })?,
    };
    Ok(vec![Way::Vulkan { number, backend }])
}

/// The ways that `auto` tries, in order.
pub(super) fn automatic(cards: &[Card]) -> Vec<Way> {
    let real = cards.iter().enumerate().filter(|(_, card)| card.is_graphics_processor());
    let ways = real.flat_map(|(number, card)| {
        let able = card.backends().into_iter().filter(|&b| card.can(b));
        able.map(move |backend| Way::Vulkan { number, backend })
    });
    ways.chain([Way::Cpu]).collect()
}

/// The number of the device that `device` names: by its number if such a device exists, otherwise by a part of its name. A part that is a
/// number is a whole word of it: 4090 names a card, and 2 is not the beginning of 2080.
fn numbered(cards: &[Card], device: &str) -> std::result::Result<usize, String> {
    let here = |numbers: &[usize]| {
        numbers.iter().map(|&i| format!("{i} {}", cards[i].name)).collect::<Vec<_>>().join(", ")
    };
    let unknown = || format!("no such device; here are {}", here(&(0..cards.len()).collect::<Vec<_>>()));
    if let Some(number) = device.parse().ok().filter(|&n: &usize| n < cards.len()) {
        return Ok(number);
    }
    let wanted = device.to_lowercase();
    let is_number = !wanted.is_empty() && wanted.bytes().all(|b| b.is_ascii_digit());
    let those = |fits: &dyn Fn(&str) -> bool| -> Vec<usize> {
        (0..cards.len()).filter(|&i| fits(&cards[i].name.to_lowercase())).collect()
    };
    let is_part = |name: &str| match is_number {
        true => name.split_whitespace().any(|word| word == wanted),
        false => name.contains(&wanted),
    };
    // A whole name wins, because it may also be a part of another device's name.
    let whole = those(&|name| name == wanted);
    let named = if whole.is_empty() { those(&is_part) } else { whole };
    match named[..] {
        [number] if !wanted.is_empty() => Ok(number),
        [] | [_] => Err(unknown()),
        _ => Err(format!("the name fits several devices, give a number: {}", here(&named))),
    }
}

/// The text that says which features a device lacks for a backend.
fn lacks(number: usize, card: &Card, backend: Backend) -> String {
    format!("{number} {} lacks {}", card.name, card.missing(backend).join(", "))
}

#[cfg(test)]
pub(super) mod tests {
    use pumice_vulkan::device::DeviceKind;

    use super::*;

    pub(in crate::backend) fn card(name: &str, kind: DeviceKind, missing: [&str; 3]) -> Card {
        let list = |m: &str| if m.is_empty() { Vec::new() } else { vec![m.to_string()] };
        let driver = "Vulkan 1.3.0, made up".into();
        Card { name: name.into(), kind, driver, missing: missing.map(list), native_f64: true }
    }

    fn two() -> Vec<Card> {
        vec![
            card("Radeon 9", DeviceKind::Discrete, ["", "VK_KHR_ray_query", ""]),
            card("Radeon 5", DeviceKind::Integrated, ["VK_KHR_ray_tracing_pipeline", "", ""]),
            card("llvmpipe", DeviceKind::Software, ["", "", ""]),
        ]
    }

    fn ways(name: &str, cards: Vec<Card>) -> std::result::Result<Vec<Way>, String> {
        choose(name, || Ok(cards)).map_err(|e| e.to_string())
    }

    fn vulkan(number: usize, backend: Backend) -> Way {
        Way::Vulkan { number, backend }
    }

    #[test]
    fn auto_tries_graphics_processors_alone_and_the_cpu_last() {
        let expected = vec![
            vulkan(0, Backend::RayPipeline),
            vulkan(0, Backend::Compute),
            vulkan(1, Backend::RayQuery),
            vulkan(1, Backend::Compute),
            Way::Cpu,
        ];
        assert_eq!(ways("auto", two()), Ok(expected));
        let other = card("Abacus", DeviceKind::Other, ["", "", ""]);
        assert_eq!(ways("auto", vec![other, two().remove(2)]), Ok(vec![Way::Cpu]));
        let none = choose("auto", || Err("no Vulkan here: no loader".into()));
        assert_eq!(none.unwrap(), [Way::Cpu]);
    }

    /// Where it is known what a driver's compiler makes of the shaders, `auto` begins with the backend that fits the card best.
    #[test]
    fn auto_begins_with_what_the_compiler_fits_best() {
        let order = |driver: &str, native_f64, missing| {
            let card = card("A card", DeviceKind::Discrete, missing);
            ways("auto", vec![Card { driver: driver.into(), native_f64, ..card }]).unwrap()
        };
        let [rt, query, compute] = Backend::ALL.map(|backend| vulkan(0, backend));
        let (mesa, other) =
            ("Vulkan 1.4.305, radv Mesa 25.0.7-2~bpo12+1", "Vulkan 1.4.312, NVIDIA 580.159.04");
        assert_eq!(order(other, true, ["", "", ""]), [rt, query, compute, Way::Cpu]);
        assert_eq!(order(mesa, true, ["", "", ""]), [query, compute, rt, Way::Cpu]);
        assert_eq!(order(mesa, true, ["", "no queries", ""]), [compute, rt, Way::Cpu]);
        for driver in [mesa, other] {
            assert_eq!(order(driver, false, ["", "", ""]), [compute, query, rt, Way::Cpu]);
        }
    }

    #[test]
    fn a_named_backend_stands_alone() {
        assert_eq!(ways("vulkan-rt", two()), Ok(vec![vulkan(0, Backend::RayPipeline)]));
        assert_eq!(ways("vulkan-query", two()), Ok(vec![vulkan(1, Backend::RayQuery)]));
        assert_eq!(ways("vulkan-rt:2", two()), Ok(vec![vulkan(2, Backend::RayPipeline)]));
        assert_eq!(ways("vulkan-rt:LLVM", two()), Ok(vec![vulkan(2, Backend::RayPipeline)]));
        assert_eq!(ways("vulkan-compute:radeon 5", two()), Ok(vec![vulkan(1, Backend::Compute)]));
        // No device has this number, so it is taken as a word of a name.
        assert_eq!(ways("vulkan-compute:9", two()), Ok(vec![vulkan(0, Backend::Compute)]));
        let mut software = two();
        software[0].name = "LLVM 15.0.6, 9 bits, RTX 2080".into();
        assert_eq!(ways("vulkan-compute:2080", software.clone()), Ok(vec![vulkan(0, Backend::Compute)]));
        for no_word in ["6", "15", "20", "208"] {
            let text = ways(&format!("vulkan-compute:{no_word}"), software.clone()).unwrap_err();
            assert!(text.contains("no such device"), "{text}");
        }
        let mut cards = two();
        cards[1].name = "Radeon".into();
        assert_eq!(ways("vulkan-compute:radeon", cards), Ok(vec![vulkan(1, Backend::Compute)]));
        let untouched = choose("cpu", || panic!("Vulkan was asked"));
        assert_eq!(untouched.unwrap(), [Way::Cpu]);
    }

    #[test]
    fn what_cannot_be_is_said_in_one_line() {
        for (name, part) in [
            ("abacus", "backend abacus: no such backend; expected auto, cpu, vulkan-rt"),
            ("cpu:0", "no such backend"),
            ("", "no such backend"),
            ("vulkan-rt:1", "1 Radeon 5 lacks VK_KHR_ray_tracing_pipeline"),
            ("vulkan-rt:7", "no such device; here are 0 Radeon 9, 1 Radeon 5, 2 llvmpipe"),
            ("vulkan-rt:", "the name fits several devices"),
            ("vulkan-rt:radeon", "the name fits several devices, give a number: 0 Radeon 9, 1 Radeon 5"),
            ("vulkan-rt:geforce", "no such device"),
        ] {
            let text = ways(name, two()).unwrap_err();
            assert!(text.contains(part), "{text}");
            assert!(!text.contains('\n'), "{text}");
        }
        let one = vec![card("Radeon 9", DeviceKind::Discrete, ["a", "b", "c"])];
        let text = ways("vulkan-query", one.clone()).unwrap_err();
        assert_eq!(text, "backend vulkan-query: no device here supports it: 0 Radeon 9 lacks b");
        assert!(ways("vulkan-query:", one).unwrap_err().contains("no such device"));
        assert!(ways("vulkan-query", Vec::new()).unwrap_err().contains("finds no device"));
        let absent = choose("vulkan-rt", || Err("no Vulkan here: no loader (gone)".into()));
        let text = absent.unwrap_err().to_string();
        assert_eq!(text, "backend vulkan-rt: no Vulkan here: no loader (gone)");
    }
}
