//! Line charts: learning curves, convergence, values.

use super::axes::{self, Grid};
use super::palette::Paint;
use super::plot::Scale;
use super::sheet::{MARGIN, Sheet, Sign};
use super::svg::{self, Anchor, Element, label, text_width};
use pilotage::error::{Error, Result};

const SIZE: (f64, f64) = (620.0, 340.0);
/// Lines are also told apart by their strokes.
const DASHES: [&str; 4] = ["", "8 4", "2.5 3", "10 3 2.5 3"];
/// Most lines that bear their names at their ends; more are named in a legend.
const MOST_NAMED: usize = 8;
const NAME: f64 = 12.0;

/// A line of a chart.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    /// What it is.
    pub name: String,
    /// Its points, in the order in which they are joined. One that is not finite breaks the line.
    pub points: Vec<(f64, f64)>,
    /// Lower and upper end of an interval around every point, such as a confidence interval.
    pub band: Option<Vec<(f64, f64)>>,
}

/// Draws lines over common axes.
///
/// # Errors
/// [`Error::Setting`] if there is no finite point at all, or a band has not one interval a point.
pub fn curves_svg(title: &str, x_label: &str, y_label: &str, series: &[Series]) -> Result<String> {
    let (x_data, y_data) = extent(series)?;
    let named = series.len() <= MOST_NAMED;
    let names = series.iter().map(|line| text_width(&line.name, NAME));
    let right = if named {
        names.fold(0.0, f64::max) + 26.0
    } else {
        0.0
    };
    let y_data = padded(y_data);
    let left = axes::left_of(y_data);
    let subtitle = "";
    let description = format!(
        "Chart of {y_label} over {x_label}: {}.",
        series
            .iter()
            .map(|line| line.name.as_str())
            .collect::<Vec<_>>()
            .join(", ")
    );
    let mut sheet = Sheet::new(title, subtitle, &description, left + SIZE.0 + right);
    let top = sheet.y() + 14.0;
    let x = Scale::new(x_data, (MARGIN + left, MARGIN + left + SIZE.0));
    let y = Scale::new(y_data, (top + SIZE.1, top));

    let mut body =
        vec![label((MARGIN, top - 10.0), axes::TEXT, Anchor::Start, y_label).fill(Paint::Ink)];
    body.extend(axes::horizontal(
        &x,
        (top, top + SIZE.1),
        x_label,
        Grid::Lines,
    ));
    body.extend(axes::vertical(&x, &y, Grid::Lines));
    body.extend(
        series
            .iter()
            .enumerate()
            .flat_map(|(k, line)| band(k, line, &x, &y)),
    );
    body.extend(
        series
            .iter()
            .enumerate()
            .flat_map(|(k, line)| drawn(k, line, &x, &y)),
    );
    if named {
        body.extend(names_at_ends(series, &x, &y));
    }
    sheet.draw(body, 14.0 + SIZE.1 + axes::BELOW);
    if !named {
        let entry = |(k, line): (usize, &Series)| {
            (
                Sign::Line(Paint::LineHue(k), DASHES[k % DASHES.len()]),
                line.name.clone(),
            )
        };
        sheet.legend(&series.iter().enumerate().map(entry).collect::<Vec<_>>());
    }
    Ok(sheet.finish())
}

fn finite(&(x, y): &(f64, f64)) -> bool {
    x.is_finite() && y.is_finite()
}

type Range = (f64, f64);

fn extent(series: &[Series]) -> Result<(Range, Range)> {
    let widen = |(low, high): Range, value: f64| (low.min(value), high.max(value));
    let nothing = (f64::INFINITY, f64::NEG_INFINITY);
    let (mut x, mut y) = (nothing, nothing);
    for line in series {
        let bands = line.band.as_deref().unwrap_or_default();
        if line.band.is_some() && bands.len() != line.points.len() {
            return Err(Error::Setting {
                setting: "band",
                value: format!("{} intervals", bands.len()),
                range: "one interval a point",
            });
        }
        for point in line.points.iter().filter(|point| finite(point)) {
            x = widen(x, point.0);
            y = widen(y, point.1);
        }
        for band in bands.iter().filter(|band| finite(band)) {
            y = widen(widen(y, band.0), band.1);
        }
    }
    if x.0 > x.1 {
        return Err(Error::Setting {
            setting: "series",
            value: "no finite point".to_owned(),
            range: "at least one finite point",
        });
    }
    Ok((x, y))
}

/// A little air above and below; none below 0 for what is never negative.
fn padded((low, high): Range) -> Range {
    let air = if high > low {
        0.05 * (high - low)
    } else {
        0.5 * low.abs().max(1.0)
    };
    let below = if low >= 0.0 {
        (low - air).max(0.0)
    } else {
        low - air
    };
    (below, high + air)
}

fn band(k: usize, line: &Series, x: &Scale, y: &Scale) -> Vec<Element> {
    let Some(bands) = &line.band else {
        return Vec::new();
    };
    let pairs: Vec<((f64, f64), (f64, f64))> = line
        .points
        .iter()
        .copied()
        .zip(bands.iter().copied())
        .collect();
    pairs
        .split(|(point, band)| !finite(point) || !finite(band))
        .filter(|piece| piece.len() > 1)
        .map(|piece| {
            let upper = piece
                .iter()
                .map(|(point, band)| (x.at(point.0), y.at(band.1)));
            let lower = piece
                .iter()
                .rev()
                .map(|(point, band)| (x.at(point.0), y.at(band.0)));
            let outline: Vec<(f64, f64)> = upper.chain(lower).collect();
            svg::through(&outline, true)
                .fill(Paint::Hue(k))
                .with("fill-opacity", 0.2)
        })
        .collect()
}

fn drawn(k: usize, line: &Series, x: &Scale, y: &Scale) -> Vec<Element> {
    let pieces = line.points.split(|point| !finite(point));
    pieces
        .filter_map(|piece| {
            let points: Vec<(f64, f64)> = piece
                .iter()
                .map(|point| (x.at(point.0), y.at(point.1)))
                .collect();
            match points.as_slice() {
                [] => None,
                [only] => Some(svg::circle(*only, 3.0).fill(Paint::LineHue(k))),
                _ => {
                    let line = svg::through(&thinned(&points), false)
                        .with("fill", "none")
                        .stroke(Paint::LineHue(k), 2.0)
                        .with("stroke-linejoin", "round");
                    Some(match DASHES[k % DASHES.len()] {
                        "" => line,
                        dashes => line.with("stroke-dasharray", dashes),
                    })
                }
            }
        })
        .collect()
}

/// Of the points that fall within one unit of paper, the first, least, greatest and last: it looks the same (U. Jugel et al.,
/// "M4: a visualization-oriented time series data aggregation", 2014).
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut kept = Vec::new();
    for column in points.chunk_by(|a, b| a.0.floor() == b.0.floor()) {
        let least = (0..column.len()).min_by(|&a, &b| column[a].1.total_cmp(&column[b].1));
        let greatest = (0..column.len()).max_by(|&a, &b| column[a].1.total_cmp(&column[b].1));
        let mut wanted: Vec<usize> = [Some(0), least, greatest, Some(column.len() - 1)]
            .into_iter()
            .flatten()
            .collect();
        wanted.sort_unstable();
        wanted.dedup();
        kept.extend(wanted.into_iter().map(|k| column[k]));
    }
    kept
}

/// Names right of the plot, each as near to the end of its line as the others leave room.
fn names_at_ends(series: &[Series], x: &Scale, y: &Scale) -> Vec<Element> {
    const LEADING: f64 = 16.0;
    let mut ends: Vec<(usize, (f64, f64))> = series
        .iter()
        .enumerate()
        .filter_map(|(k, line)| {
            let last = line.points.iter().rfind(|point| finite(point))?;
            Some((k, (x.at(last.0), y.at(last.1))))
        })
        .collect();
    ends.sort_by(|a, b| a.1.1.total_cmp(&b.1.1).then(a.0.cmp(&b.0)));
    let (bottom, top) = y.paper;
    let mut places: Vec<f64> = Vec::with_capacity(ends.len());
    for (_, (_, wanted)) in &ends {
        let free = places.last().map_or(top, |above| above + LEADING);
        places.push(wanted.max(free));
    }
    let mut floor = bottom;
    for place in places.iter_mut().rev() {
        *place = place.min(floor);
        floor = *place - LEADING;
    }
    let left = x.paper.1 + 22.0;
    ends.iter()
        .zip(&places)
        .flat_map(|(&(k, end), &place)| {
            let leader = [end, (x.paper.1 + 6.0, end.1), (left - 4.0, place)];
            [
                svg::through(&leader, false)
                    .with("fill", "none")
                    .stroke(Paint::LineHue(k), 1.5),
                label((left, place + 4.0), NAME, Anchor::Start, &series[k].name).fill(Paint::Ink),
            ]
        })
        .collect()
}
