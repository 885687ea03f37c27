//! The page that a comparison makes: one HTML file with everything in it, for readers who have neither program.
//!
//! It has no script. The wipe between the two pictures is a box that CSS lets a reader resize.

use std::fmt::Write as _;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use pumice_core::write_text;
use pumice_picture::agreement::{LEVEL, Verdict, counted, percent};
use pumice_picture::{Image, Pass, Picture, ViewTransform, png_bytes};

use super::charts::{error_svg, histogram_svg};
use super::{Cost, VerifiedRender, VerifyRenderRequest};
use crate::error::{Result, SessionError, io};

/// Refuses a page whose name or folder is wrong, before the work.
pub(super) fn check_name(request: &VerifyRenderRequest) -> Result<()> {
    let Some(path) = &request.page else { return Ok(()) };
    if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("html")) {
        let path = path.display();
        return Err(SessionError::Caller(format!("{path}: expected a name that ends in .html")));
    }
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::metadata(folder).map_err(io(folder))?;
    }
    Ok(request.reading.outputs.declare(path)?)
}

/// A picture's colour, over white where the film is transparent.
pub(super) fn over_white(picture: &Picture) -> Image {
    let Some(alpha) = &picture.alpha else { return picture.color.clone() };
    let shadow = picture.light.iter().find(|(pass, _)| *pass == Pass::ShadowCatcher).map(|(_, image)| image);
    let pixels = picture.color.pixels.iter().zip(alpha).enumerate().map(|(i, (color, alpha))| {
        let under = shadow.map_or([1.0; 3], |image| image.pixels[i]);
        [0, 1, 2].map(|c| color[c] + (1.0 - alpha) * under[c])
    });
    Image::new(picture.color.width, picture.color.height, pixels.collect())
}

/// Writes the page. It appears complete or not at all.
///
/// # Errors
/// When the file cannot be written.
pub(super) fn write_page(
    path: &Path,
    request: &VerifyRenderRequest,
    verified: &VerifiedRender,
) -> Result<()> {
    let html = page(request, verified)?;
    Ok(write_text(path, &html)?)
}

const STYLE: &str = "
:root { color-scheme: light; font: 16px/1.5 system-ui, sans-serif; color: #222; background: #fff }
body { max-width: 60rem; margin: 2rem auto; padding: 0 1rem }
h1 { font-size: 1.4rem } h2 { font-size: 1.1rem; margin-top: 2.2rem }
.verdict { border-left: .5rem solid #888; padding: .6rem 1rem; background: #f5f5f5; font-size: 1.15rem }
.agrees { border-color: #2b7a3d } .differs { border-color: #b3261e } .cannot_tell { border-color: #b58900 }
table { border-collapse: collapse } td, th { padding: .2rem .9rem .2rem 0; text-align: left; vertical-align: top; font-weight: normal }
th { color: #555 } td.n { text-align: right; font-variant-numeric: tabular-nums }
img { image-rendering: pixelated; display: block; width: 100% }
.wipe { position: relative; overflow: hidden; container-type: inline-size } .wipe .over { position: absolute; inset: 0 auto 0 0; width: 50%; min-width: 1.5rem;
  max-width: 100%; overflow: hidden; resize: horizontal; border-right: 2px solid #fff; box-shadow: 1px 0 0 #000 }
.wipe .over img { width: 100cqw; max-width: none; height: 100% }
.maps { display: grid; grid-template-columns: repeat(auto-fit, minmax(17rem, 1fr)); gap: 1rem } figure { margin: 0 }
figcaption { font-size: .85rem; color: #444 } code { overflow-wrap: anywhere; font-size: .85rem }
";

fn page(request: &VerifyRenderRequest, verified: &VerifiedRender) -> Result<String> {
    let VerifiedRender { agreement, maps, .. } = verified;
    let view = ViewTransform::Standard;
    let shown =
        |image: &Image| -> Result<String> { Ok(embedded(&png_bytes(&Picture::of(image.clone()), view)?)) };
    let class = match agreement.verdict {
        Verdict::Agrees => "agrees",
        Verdict::Differs => "differs",
        Verdict::CannotTell => "cannot_tell",
    };
    let chance = |level: f64| format!("{:.2} %", 100.0 * level);
    let equality = &agreement.equality;
    let by_chance = match equality.ratio_by_chance {
        Some([low, high]) => format!("{low:.3} to {high:.3}"),
        None => "unknown with so few pictures".to_owned(),
    };
    let mut html = String::new();
    // Writing to a string cannot fail.
    let _ = write!(
        html,
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Pumice against Cycles: {class}</title>\
         <meta name=\"viewport\" content=\"width=device-width\"><style>{STYLE}</style></head><body>\n\
         <h1>Does Pumice draw what Cycles draws?</h1>\n<p class=\"verdict {class}\" id=\"verdict\">{}</p>\n\
         <p>Judged from {} by Pumice and {} by Cycles, each of {} samples per pixel and of a seed of its own. A verdict is \
         false in at most {} of comparisons: <em>agrees</em> where the true difference is beyond a margin, <em>differs</em> where it is \
         within all. This look spends {} of that.</p>\n",
        escaped(&verified.sentence),
        counted(agreement.pictures[0]),
        counted(agreement.pictures[1]),
        verified.spp,
        chance(LEVEL),
        chance(agreement.level),
    );
    let _ = writeln!(
        html,
        "<h2>The pictures</h2><p>Pumice is on the left, Cycles on the right; drag the handle in the lower corner of the left one.</p>\
         <div class=\"wipe\"><img alt=\"by Cycles\" src=\"{}\"><div class=\"over\">\
         <img alt=\"by Pumice\" src=\"{}\"></div></div>",
        shown(&maps.cycles)?,
        shown(&maps.pumice)?,
    );
    let maps = [
        (
            shown(&maps.difference_color)?,
            "Signed difference by pixel, noise included: red where Pumice is brighter; full colour at 5 % of the picture's mean.",
        ),
        (
            shown(&maps.tile_difference_color)?,
            "Difference by tile of 8 × 8 pixels, in the channel where it is largest: full colour at the margin of 1 %.",
        ),
        (
            shown(&maps.tile_t_color)?,
            "Welch's t by tile: how sure the difference is, not how large; full colour at 6.",
        ),
        (shown(&maps.flip_color)?, "FLIP: what an eye sees when flipping between the two; black is nothing."),
    ];
    html.push_str("<h2>Where they differ</h2><div class=\"maps\">");
    for (source, caption) in maps {
        let _ = write!(
            html,
            "<figure><img alt=\"\" src=\"{source}\"><figcaption>{caption}</figcaption></figure>"
        );
    }
    html.push_str("</div>\n<h2>Figures</h2><table>");
    let mean = agreement.mean.map(|i| {
        format!(
            "{} ± {:.2} %",
            percent(i.difference / agreement.scale),
            100.0 * i.half_width / agreement.scale
        )
    });
    let [within, open, outside] = agreement.standing;
    for (name, value) in [
        ("Difference of the picture's mean, by channel", mean.join(", ")),
        ("Tiles and channels within 1 %, undecided, beyond", format!("{within}, {open}, {outside}")),
        ("Masked, of the covered pixels", format!("{:.2} %", 100.0 * agreement.masked)),
        ("relMSE of the means", format!("{:.2e}", verified.comparison.rel_mse)),
        ("FLIP of the means", format!("{:.4}", verified.comparison.flip)),
        (
            "Test of equality: squared difference over noise",
            format!("{:.3}; by chance {by_chance}", equality.ratio),
        ),
        (
            "Test of equality: tiles and channels rejected at 1 %",
            format!("{} of {}", equality.rejected, equality.tests),
        ),
        (
            "Test of equality: the mean, in standard errors",
            format!("{:.1}", equality.mean_in_standard_errors),
        ),
    ] {
        let _ = write!(html, "<tr><th>{name}</th><td>{value}</td></tr>");
    }
    html.push_str("</table>\n<h2>Time and memory</h2><table><tr><th></th><th>build, s</th><th>pictures, s</th><th>CPU s</th><th>memory, MB</th><th>error left</th></tr>");
    for cost in [&verified.ours, &verified.theirs] {
        html.push_str(&row_of(cost));
    }
    html.push_str("</table>\n<p>Memory is that of our renderer and its volumes, and that of Blender's process. The error is the estimated \
                   relative error of the mean of all pictures.</p>");
    let curves =
        [(&*verified.ours.name, &*verified.ours.curve), (&*verified.theirs.name, &*verified.theirs.curve)];
    if let Some(svg) = error_svg(curves) {
        html.push_str(&svg);
    }
    let _ = write!(
        html,
        "\n<h2>Chance</h2><p>Without a difference every p-value is as likely as any other. The grey band holds 99 of 100 bars; a tall \
         first bar is a difference.</p>{}\n",
        histogram_svg(agreement)
    );
    html.push_str("<h2>What was compared</h2><table>");
    for (name, value) in [
        ("Scene", request.input.display().to_string()),
        ("Hashes of the volumes", verified.volume_hashes.join(", ")),
        ("Surface", format!("{}, {} faces in Cycles", verified.surface, verified.faces)),
        (
            "Pictures",
            format!("{} × {} pixels, {} samples each", verified.size[0], verified.size[1], verified.spp),
        ),
        (
            "Seeds",
            match agreement.pictures[0] {
                1 => "number 1, somewhere in the range of each program's seeds".to_owned(),
                n => format!("numbers 1 to {n}, spread over the range of each program's seeds"),
            },
        ),
        ("Programs", format!("{}; {}", verified.ours.name, verified.theirs.name)),
        ("Command", request.command.clone()),
    ] {
        let _ = write!(html, "<tr><th>{name}</th><td><code>{}</code></td></tr>", escaped(&value));
    }
    html.push_str("</table>");
    if !verified.notes.is_empty() {
        html.push_str("<h2>What was changed or left out</h2><ul>");
        for note in &verified.notes {
            let _ = write!(html, "<li>{}</li>", escaped(note));
        }
        html.push_str("</ul>");
    }
    html.push_str("\n</body></html>\n");
    Ok(html)
}

fn row_of(cost: &Cost) -> String {
    format!(
        "<tr><td>{}</td><td class=\"n\">{:.1}</td><td class=\"n\">{:.1}</td><td class=\"n\">{:.1}</td><td class=\"n\">{:.0}</td>\
         <td class=\"n\">{:.2} %</td></tr>",
        escaped(&cost.name),
        cost.build_seconds,
        cost.seconds,
        cost.cpu_seconds,
        cost.bytes as f64 / 1e6,
        100.0 * cost.error_estimate
    )
}

fn embedded(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", STANDARD.encode(png))
}

/// A text inside HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_cannot_become_markup() {
        assert_eq!(escaped("<a href=\"x\">&"), "&lt;a href=&quot;x&quot;&gt;&amp;");
    }

    #[test]
    fn alpha_and_shadows_are_laid_over_white() {
        let mut picture = Picture::of(Image::new(1, 1, vec![[0.25; 3]]));
        assert_eq!(over_white(&picture).pixels, [[0.25; 3]]);
        picture.alpha = Some(vec![0.5]);
        assert_eq!(over_white(&picture).pixels, [[0.75; 3]]);
        picture.light.push((Pass::ShadowCatcher, Image::new(1, 1, vec![[0.5, 1.0, 0.0]])));
        assert_eq!(over_white(&picture).pixels, [[0.5, 0.75, 0.25]]);
    }
}
