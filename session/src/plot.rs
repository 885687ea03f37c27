//! Plots curves on logarithmic axes as SVG.

use crate::progressive::CurvePoint;
use plotters::prelude::*;

/// The error of a picture over time, as a named curve.
pub struct Series<'a> {
    /// Name in the legend.
    pub name: &'a str,
    /// Points; those without an error estimate are not drawn.
    pub points: &'a [CurvePoint],
}

/// Axes of a plot.
pub struct Axes<'a> {
    /// Quantity and unit along x.
    pub x: &'a str,
    /// Quantity and unit along y.
    pub y: &'a str,
    /// Decimal digits of the labels along y.
    pub y_digits: usize,
    /// A grey guide line, if there is one: its slope on logarithmic scales, and its name.
    pub slope: Option<(f64, &'a str)>,
}

/// A named curve, whose coordinates are above 0.
pub struct Curve<'a> {
    /// Name in the legend.
    pub name: &'a str,
    /// Points (x, y) by increasing x.
    pub points: Vec<(f64, f64)>,
}

/// Plots estimated relative error (per cent, log) over wall seconds (log), with a guide line of slope 1/√time. `None` if no point has an
/// estimate, as happens when a short time on a busy machine allows fewer samples than an estimate takes.
///
/// # Errors
/// A line of text when the plot library fails.
pub fn error_against_time_svg(title: &str, series: &[Series<'_>]) -> Result<Option<String>, String> {
    let known = |s: &Series<'_>| -> Vec<(f64, f64)> {
        let point =
            |p: &CurvePoint| p.error_estimate.filter(|&e| e > 0.0).map(|e| (p.seconds.max(1e-3), e * 100.0));
        s.points.iter().filter_map(point).collect()
    };
    let curves: Vec<Curve<'_>> = series.iter().map(|s| Curve { name: s.name, points: known(s) }).collect();
    if curves.iter().all(|c| c.points.is_empty()) {
        return Ok(None);
    }
    let axes =
        Axes {
            x: "seconds", y: "estimated relative error, %", y_digits: 2, slope: Some((-0.5, "1/√time"))
        };
    log_log_svg(title, &axes, &curves).map(Some)
}

/// Plots curves on logarithmic axes, and the guide line through the first curve's last point.
///
/// # Errors
/// A line of text when there is no point to plot or the plot library fails.
pub fn log_log_svg(title: &str, axes: &Axes<'_>, curves: &[Curve<'_>]) -> Result<String, String> {
    let all: Vec<(f64, f64)> = curves.iter().flat_map(|c| c.points.iter().copied()).collect();
    let bound = |pick: fn(&(f64, f64)) -> f64, fold: fn(f64, f64) -> f64| all.iter().map(pick).reduce(fold);
    let (Some(x0), Some(x1)) = (bound(|p| p.0, f64::min), bound(|p| p.0, f64::max)) else {
        return Err("no point to plot".into());
    };
    let (Some(y0), Some(y1)) = (bound(|p| p.1, f64::min), bound(|p| p.1, f64::max)) else {
        return Err("no point to plot".into());
    };
    let short = |value: f64, digits: usize| {
        let text = format!("{value:.digits$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
    };
    let mut svg = String::new();
    let mut draw = || -> Result<(), Box<dyn std::error::Error + '_>> {
        let root = SVGBackend::with_string(&mut svg, (720, 420)).into_drawing_area();
        root.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&root)
            .caption(title, ("sans-serif", 18))
            .margin(12)
            .x_label_area_size(42)
            .y_label_area_size(58)
            .build_cartesian_2d(
                ((x0 * 0.8)..(x1 * 1.25)).log_scale(),
                ((y0 * 0.8)..(y1 * 1.25)).log_scale(),
            )?;
        chart
            .configure_mesh()
            .x_desc(axes.x)
            .y_desc(axes.y)
            .x_label_formatter(&|x| short(*x, 3))
            .y_label_formatter(&|y| short(*y, axes.y_digits))
            .light_line_style(RGBColor(238, 238, 238))
            .draw()?;
        if let Some((&(x, y), (slope, name))) = curves.first().and_then(|c| c.points.last()).zip(axes.slope) {
            let line = [x0, x1].map(|end| (end, y * (end / x).powf(slope)));
            chart
                .draw_series(LineSeries::new(line, RGBColor(170, 170, 170).stroke_width(1)))?
                .label(name)
                .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], RGBColor(170, 170, 170)));
        }
        let colors = [
            RGBColor(31, 101, 166),
            RGBColor(201, 88, 46),
            RGBColor(72, 132, 72),
            RGBColor(130, 80, 150),
            RGBColor(160, 130, 20),
            RGBColor(30, 150, 160),
            RGBColor(200, 70, 130),
            RGBColor(100, 100, 100),
            RGBColor(120, 70, 40),
            RGBColor(120, 170, 30),
        ];
        for (curve, color) in curves.iter().zip(colors.iter().cycle()) {
            let style = color.stroke_width(2);
            chart
                .draw_series(LineSeries::new(curve.points.iter().copied(), style).point_size(3))?
                .label(curve.name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style));
        }
        chart
            .configure_series_labels()
            .background_style(WHITE)
            .border_style(RGBColor(200, 200, 200))
            .draw()?;
        root.present()?;
        Ok(())
    };
    draw().map_err(|e| format!("the plot could not be drawn: {e}"))?;
    Ok(svg)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_becomes_a_well_formed_plot_and_an_empty_one_says_so() {
        let points: Vec<CurvePoint> = (1..9)
            .map(|i| CurvePoint {
                seconds: f64::from(i),
                cpu_seconds: 2.0 * f64::from(i),
                mean_spp: 0.0,
                spp: i as u32,
                error_estimate: (i > 2).then(|| 0.3 / f64::from(i).sqrt()),
            })
            .collect();
        let svg = error_against_time_svg("t", &[Series { name: "cpu", points: &points }]).unwrap().unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        // Six of the eight points have an estimate, so the curve has six vertices.
        let line = svg.lines().find(|l| l.contains("<polyline") && l.contains("#1F65A6")).unwrap();
        assert_eq!(line.split("points=").nth(1).unwrap().matches(',').count(), 6, "{line}");
        let none = error_against_time_svg("t", &[Series { name: "cpu", points: &points[..2] }]);
        assert_eq!(none, Ok(None));
    }
}
