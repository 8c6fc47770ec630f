//! Cells of point nodes in a plane.

use crate::layout::Point;

/// The part of a convex polygon where `a x + b y <= c` (I. Sutherland and G. Hodgman, 1974).
fn clipped(polygon: &[Point], (a, b, c): (f64, f64, f64)) -> Vec<Point> {
    let beyond = |(x, y): Point| a * x + b * y - c;
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (k, &to) in polygon.iter().enumerate() {
        let from = polygon[(k + polygon.len() - 1) % polygon.len()];
        let (out, into) = (beyond(from), beyond(to));
        if (out <= 0.0) != (into <= 0.0) {
            let share = out / (out - into);
            kept.push((
                from.0 + share * (to.0 - from.0),
                from.1 + share * (to.1 - from.1),
            ));
        }
        if into <= 0.0 {
            kept.push(to);
        }
    }
    kept
}

/// A point with what the variables outside the plane add to its squared distance from everywhere in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Site {
    /// Where it is in the plane.
    pub at: Point,
    /// Squared distance from the plane.
    pub apart: f64,
}

/// Where in the box each site is the nearest, distances along the axes divided by the scale.
pub fn cells(sites: &[Site], low: Point, high: Point, scale: (f64, f64)) -> Vec<Vec<Point>> {
    let square = |x: f64| x * x;
    let (wx, wy) = (square(1.0 / scale.0), square(1.0 / scale.1));
    let size = |site: &Site| wx * square(site.at.0) + wy * square(site.at.1) + site.apart;
    sites
        .iter()
        .enumerate()
        .map(|(k, site)| {
            let whole = vec![low, (high.0, low.1), high, (low.0, high.1)];
            let others = sites.iter().enumerate().filter(|(other, _)| *other != k);
            others.fold(whole, |cell, (_, other)| {
                let (a, b) = (
                    2.0 * wx * (other.at.0 - site.at.0),
                    2.0 * wy * (other.at.1 - site.at.1),
                );
                clipped(&cell, (a, b, size(other) - size(site)))
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn area(polygon: &[Point]) -> f64 {
        let next = |k: usize| polygon[(k + 1) % polygon.len()];
        let twice: f64 = polygon
            .iter()
            .enumerate()
            .map(|(k, p)| p.0 * next(k).1 - next(k).0 * p.1)
            .sum();
        0.5 * twice.abs()
    }

    proptest! {
        #[test]
        fn cells_fill_the_box(points in proptest::collection::vec((0.0..4.0, 0.0..3.0, 0.0..2.0), 1..20)) {
            let sites: Vec<Site> = points.iter().map(|&(x, y, apart)| Site { at: (x, y), apart }).collect();
            let cells = cells(&sites, (0.0, 0.0), (4.0, 3.0), (1.0, 2.0));
            let total: f64 = cells.iter().map(|cell| area(cell)).sum();
            prop_assert!((total - 12.0).abs() < 1e-6);
        }
    }
}
