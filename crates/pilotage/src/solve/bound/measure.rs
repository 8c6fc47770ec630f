//! Grids on which moves end where they began.

/// The largest number of which all displacements are multiples, within a millionth.
pub(super) fn common_measure(displacement: &[f64]) -> Option<f64> {
    let measure = displacement.iter().fold(0.0, |measure: f64, d| {
        let (mut x, mut y) = (measure.max(d.abs()), measure.min(d.abs()));
        let small = 1e-6 * x;
        while y > small {
            (x, y) = (y, (x % y).min(y - x % y));
        }
        x
    });
    (measure > 0.0).then_some(measure)
}
