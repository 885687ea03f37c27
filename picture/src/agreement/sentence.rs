//! The verdict in words.

use super::verdict::{Agreement, MOST_MASKED, Verdict};

impl Agreement {
    /// The verdict in one sentence, with what is proven beside it.
    pub fn sentence(&self) -> String {
        sentence(self)
    }
}

/// A share with its sign, in per cent.
pub fn percent(share: f64) -> String {
    format!("{:+.2} %", 100.0 * share)
}

/// A number of pictures in words: `1 picture`, `8 pictures`.
pub fn counted(pictures: usize) -> String {
    if pictures == 1 { "1 picture".to_owned() } else { format!("{pictures} pictures") }
}

fn sentence(agreement: &Agreement) -> String {
    let [within, open, outside] = agreement.standing;
    let tests = within + open + outside;
    match agreement.verdict {
        Verdict::Agrees => {
            let proven = proven(agreement, "smaller difference");
            format!("Agrees: every tile lies within 1 %, the picture's mean within 0.2 %; {proven}.")
        }
        Verdict::Differs => {
            let mut where_ = Vec::new();
            if outside > 0 {
                where_.push(format!("{outside} of {tests} tiles and channels lie beyond 1 %"));
            }
            if let Some((share, [x, y])) = agreement.proven_in_tile {
                where_.push(format!("the largest is {}, at ({x}, {y})", percent(share)));
            }
            if let Some(share) = agreement.proven_in_mean {
                where_.push(format!("the picture's mean is off by {}", percent(share)));
            }
            format!("Differs: {}.", where_.join("; "))
        }
        Verdict::CannotTell if agreement.masked > MOST_MASKED => format!(
            "Cannot tell: {:.1} % of the covered pixels are not finite numbers in some picture.",
            100.0 * agreement.masked
        ),
        Verdict::CannotTell if agreement.scale == 0.0 => "Cannot tell: the pictures are black.".to_owned(),
        Verdict::CannotTell => {
            let mean = agreement.mean.iter().filter(|i| i.difference.abs() + i.half_width > i.margin).count();
            format!(
                "Cannot tell yet: with {} each, {open} of {tests} tiles and channels and {mean} of 3 means are still \
                 undecided; {}.",
                counted(agreement.pictures[0]),
                proven(agreement, "difference")
            )
        }
    }
}

/// What is proven of a `difference`, by the intervals and by the test of equality.
fn proven(agreement: &Agreement, difference: &str) -> String {
    let mut by_intervals = Vec::new();
    if let Some(share) = agreement.proven_in_mean {
        by_intervals.push(format!("{} of the picture's mean", percent(share)));
    }
    if let Some((share, [x, y])) = agreement.proven_in_tile {
        by_intervals.push(format!("up to {} in a tile, at ({x}, {y})", percent(share)));
    }
    let proofs = agreement.equality.proofs().join(", ");
    let shows = "shows in the test of equality, which errs in 2 of 100 cases";
    match (by_intervals.join(", "), proofs.as_str()) {
        (none, "") if none.is_empty() => format!("no {difference} is proven"),
        (none, proofs) if none.is_empty() => format!("a {difference} {shows}: {proofs}"),
        (found, "") => format!("a {difference} is proven: {found}"),
        (found, proofs) => format!("a {difference} is proven: {found}; it also {shows}: {proofs}"),
    }
}
