//! Error against run time as an SVG picture.

use plotters::prelude::*;

use crate::progressive::CurvePoint;

/// A named curve.
pub struct Series<'a> {
    /// Shown in the legend.
    pub name: &'a str,
    /// Points without an estimate are left out.
    pub points: &'a [CurvePoint],
}

/// Draws estimated relative error (per cent, log) over wall seconds (log), with the slope of 1/√time for the eye.
///
/// # Errors
/// A line of text when there is no point to draw or the plot library refuses.
pub fn error_against_time_svg(title: &str, series: &[Series<'_>]) -> Result<String, String> {
    let known = |s: &Series<'_>| -> Vec<(f64, f64)> {
        let point =
            |p: &CurvePoint| p.error_estimate.filter(|&e| e > 0.0).map(|e| (p.seconds.max(1e-3), e * 100.0));
        s.points.iter().filter_map(point).collect()
    };
    let all: Vec<(f64, f64)> = series.iter().flat_map(known).collect();
    let bound = |pick: fn(&(f64, f64)) -> f64, fold: fn(f64, f64) -> f64| all.iter().map(pick).reduce(fold);
    let (Some(t0), Some(t1)) = (bound(|p| p.0, f64::min), bound(|p| p.0, f64::max)) else {
        return Err("no error estimate to plot: fewer samples than replicates".into());
    };
    let (Some(e0), Some(e1)) = (bound(|p| p.1, f64::min), bound(|p| p.1, f64::max)) else {
        return Err("no error estimate to plot".into());
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
                ((t0 * 0.8)..(t1 * 1.25)).log_scale(),
                ((e0 * 0.8)..(e1 * 1.25)).log_scale(),
            )?;
        chart
            .configure_mesh()
            .x_desc("seconds")
            .y_desc("estimated relative error, %")
            .x_label_formatter(&|x| format!("{x:.3}").trim_end_matches('0').trim_end_matches('.').to_string())
            .y_label_formatter(&|y| format!("{y:.2}").trim_end_matches('0').trim_end_matches('.').to_string())
            .light_line_style(RGBColor(238, 238, 238))
            .draw()?;
        // 1/√t through the last point of the first curve.
        if let Some(&(t, e)) = series.first().map(known).as_deref().and_then(<[_]>::last) {
            let line = [(t0, e * (t / t0).sqrt()), (t1, e * (t / t1).sqrt())];
            chart
                .draw_series(LineSeries::new(line, RGBColor(170, 170, 170).stroke_width(1)))?
                .label("1/√time")
                .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], RGBColor(170, 170, 170)));
        }
        let colors =
            [RGBColor(31, 101, 166), RGBColor(201, 88, 46), RGBColor(72, 132, 72), RGBColor(130, 80, 150)];
        for (s, color) in series.iter().zip(colors.iter().cycle()) {
            let style = color.stroke_width(2);
            chart
                .draw_series(LineSeries::new(known(s), style).point_size(3))?
                .label(s.name)
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
                spp: i as u32,
                error_estimate: (i > 2).then(|| 0.3 / f64::from(i).sqrt()),
            })
            .collect();
        let svg = error_against_time_svg("t", &[Series { name: "cpu", points: &points }]).unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        // Six of the eight points have an estimate: the curve in its colour, with one dot for each.
        let line = svg.lines().find(|l| l.contains("<polyline") && l.contains("#1F65A6")).unwrap();
        assert_eq!(line.split("points=").nth(1).unwrap().matches(',').count(), 6, "{line}");
        assert!(error_against_time_svg("t", &[Series { name: "cpu", points: &points[..2] }]).is_err());
    }
}
