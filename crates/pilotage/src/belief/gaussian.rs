//! Probabilities under a Gaussian.

use nalgebra::{DMatrix, DVector};

use crate::model::{Interval, Region};

/// Standard normal cdf.
pub(crate) fn normal_cdf(x: f64) -> f64 {
    0.5 * libm::erfc(-x * std::f64::consts::FRAC_1_SQRT_2)
}

/// Standard normal density.
pub(crate) fn normal_density(x: f64) -> f64 {
    (-0.5 * x * x).exp() / (std::f64::consts::TAU).sqrt()
}

/// Steps along the coordinates of a cube whose multiples, modulo 1, are evenly spread in it: powers of the inverse of the root above 1 of
/// `x^(dim + 1) = x + 1` (M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018).
pub(crate) fn even_steps(dim: usize) -> Vec<f64> {
    const ROUNDS: usize = 60;
    let power = 1.0 / (dim as f64 + 1.0);
    let root = (0..ROUNDS).fold(2.0_f64, |x, _| (1.0 + x).powf(power));
    (1..=dim).map(|i| root.powi(-(i as i32))).collect()
}

/// Inverse of the standard normal cdf, for `p` in (0, 1): P. J. Acklam's rational approximation (2003), with one step of Halley's
/// method, which leaves errors of a few roundings.
pub(crate) fn normal_quantile(p: f64) -> f64 {
    const A: [f64; 6] = [
        -3.969683028665376e1,
        2.209460984245205e2,
        -2.759285104469687e2,
        1.38357751867269e2,
        -3.066479806614716e1,
        2.506628277459239,
    ];
    const B: [f64; 6] = [
        -5.447609879822406e1,
        1.615858368580409e2,
        -1.556989798598866e2,
        6.680131188771972e1,
        -1.328068155288572e1,
        1.0,
    ];
    const C: [f64; 6] = [
        -7.784894002430293e-3,
        -3.223964580411365e-1,
        -2.400758277161838,
        -2.549732539343734,
        4.374664141464968,
        2.938163982698783,
    ];
    const D: [f64; 5] = [
        7.784695709041462e-3,
        3.224671290700398e-1,
        2.445134137142996,
        3.754408661907416,
        1.0,
    ];
    const TAIL: f64 = 0.02425;
    let horner = |terms: &[f64], x: f64| terms.iter().fold(0.0, |sum, term| sum * x + term);
    let p = p.clamp(f64::MIN_POSITIVE, 1.0 - f64::EPSILON);
    let x = if (TAIL..=1.0 - TAIL).contains(&p) {
        let q = p - 0.5;
        q * horner(&A, q * q) / horner(&B, q * q)
    } else {
        let q = (-2.0 * p.min(1.0 - p).ln()).sqrt();
        let x = horner(&C, q) / horner(&D, q);
        if p < 0.5 { x } else { -x }
    };
    let step = (normal_cdf(x) - p) / normal_density(x);
    x - step / (1.0 + 0.5 * x * step)
}

/// Probability that N(mean, variance) lies in the interval. With no variance it is 0 or 1.
pub fn interval_probability(mean: f64, variance: f64, interval: Interval) -> f64 {
    if variance <= 0.0 {
        return f64::from(interval.contains(mean));
    }
    let sd = variance.sqrt();
    let (low, high) = ((interval.low - mean) / sd, (interval.high - mean) / sd);
    // The difference is taken in the tail where both values are small, so that it keeps its digits.
    if low > 0.0 {
        normal_cdf(-low) - normal_cdf(-high)
    } else {
        normal_cdf(high) - normal_cdf(low)
    }
}

/// Probability that N(mean, covariance) lies outside the region, its sides taken one by one: never too small, and with all its
/// digits where it is rare.
pub(crate) fn exit_probability(mean: &[f64], covariance: &DMatrix<f64>, region: &Region) -> f64 {
    // Farther than this a normal variable is outside less often than one in 1e19.
    const NEVER: f64 = 9.0;
    let beyond = |distance: f64, sd: f64| {
        if distance > NEVER * sd {
            0.0
        } else if sd > 0.0 {
            normal_cdf(-distance / sd)
        } else {
            1.0
        }
    };
    let sides = region.sides.iter().map(|&(i, side)| {
        let sd = covariance[(i, i)].sqrt();
        beyond(mean[i] - side.low, sd) + beyond(side.high - mean[i], sd)
    });
    sides.sum::<f64>().min(1.0)
}

/// Probability that N(mean, covariance) lies in the region. `mean` has length `n`, `covariance` is `n x n`.
///
/// Sides that are uncorrelated multiply; correlated ones are integrated one after the other, each given those before it
/// (A. Genz, "Numerical computation of multivariate normal probabilities", 1992, with a fixed rule instead of random points).
pub fn region_probability(mean: &[f64], covariance: &DMatrix<f64>, region: &Region) -> f64 {
    let sides: Vec<(usize, Interval)> = region
        .sides
        .iter()
        .copied()
        .filter(|(_, side)| side.low.is_finite() || side.high.is_finite())
        .collect();
    let correlated = sides.iter().enumerate().any(|(k, &(i, _))| {
        sides[..k].iter().any(|&(j, _)| {
            covariance[(i, j)].abs() > 1e-12 * (covariance[(i, i)] * covariance[(j, j)]).sqrt()
        })
    });
    if !correlated {
        return sides
            .iter()
            .map(|&(i, side)| interval_probability(mean[i], covariance[(i, i)], side))
            .product();
    }
    let means = DVector::from_iterator(sides.len(), sides.iter().map(|&(i, _)| mean[i]));
    let block = DMatrix::from_fn(sides.len(), sides.len(), |r, c| {
        covariance[(sides[r].0, sides[c].0)]
    });
    sequential_probability(means, block, &sides)
}

fn sequential_probability(
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
    sides: &[(usize, Interval)],
) -> f64 {
    let (variance, side) = (covariance[(0, 0)], sides[0].1);
    if sides.len() == 1 {
        return interval_probability(mean[0], variance, side);
    }
    let rest = sides.len() - 1;
    let covariance_rest = covariance.view((1, 1), (rest, rest)).into_owned();
    let mean_rest = mean.rows(1, rest).into_owned();
    if variance <= 0.0 {
        return f64::from(side.contains(mean[0]))
            * sequential_probability(mean_rest, covariance_rest, &sides[1..]);
    }
    let sd = variance.sqrt();
    let (low, high) = (
        ((side.low - mean[0]) / sd).max(-9.0),
        ((side.high - mean[0]) / sd).min(9.0),
    );
    if low >= high {
        return 0.0;
    }
    let slope = covariance.view((1, 0), (rest, 1)).into_owned() / sd;
    let given = covariance_rest - &slope * slope.transpose();
    let mut edges = edges_of_the_rest(&mean_rest, &slope, &given, &sides[1..]);
    edges.retain(|edge| low < *edge && *edge < high);
    edges.extend([low, high]);
    edges.sort_by(f64::total_cmp);
    edges.dedup();
    let pieces = edges.windows(2);
    pieces
        .flat_map(|piece| gauss_legendre_panels(piece[0], piece[1]))
        .map(|(x, weight)| {
            weight
                * normal_density(x)
                * sequential_probability(
                    &mean_rest + slope.column(0) * x,
                    given.clone(),
                    &sides[1..],
                )
        })
        .sum()
}

/// Where panels have to be short. Given the first variable at `x`, another passes an edge of its side as `x` moves by
/// `sqrt(given) / slope`; between variables that almost determine each other that is a jump.
fn edges_of_the_rest(
    mean: &DVector<f64>,
    slope: &DMatrix<f64>,
    given: &DMatrix<f64>,
    sides: &[(usize, Interval)],
) -> Vec<f64> {
    let mut edges = Vec::new();
    for (i, (_, side)) in sides.iter().enumerate() {
        let width = given[(i, i)].max(0.0).sqrt() / slope[i].abs();
        if width >= 1.0 {
            continue;
        }
        for edge in [side.low, side.high] {
            let centre = (edge - mean[i]) / slope[i];
            edges.extend((-4..=4).map(|k| centre + 2.0 * f64::from(k) * width));
        }
    }
    edges
}

/// Composite 8-point Gauss-Legendre rule with panels at most one wide: pairs of point and weight on `[low, high]`.
fn gauss_legendre_panels(low: f64, high: f64) -> impl Iterator<Item = (f64, f64)> {
    const RULE: [(f64, f64); 4] = [
        (0.183_434_642_495_649_8, 0.362_683_783_378_362),
        (0.525_532_409_916_329, 0.313_706_645_877_887_3),
        (0.796_666_477_413_626_7, 0.222_381_034_453_374_5),
        (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
    ];
    let panels = (high - low).ceil().max(1.0);
    let half = (high - low) / (2.0 * panels);
    (0..panels as usize).flat_map(move |panel| {
        let centre = low + (2.0 * panel as f64 + 1.0) * half;
        RULE.into_iter().flat_map(move |(x, weight)| {
            [
                (centre - half * x, half * weight),
                (centre + half * x, half * weight),
            ]
        })
    })
}

/// `points` nodes and weights for expectations under N(0, 1): `E f(x) ~ sum w_i f(x_i)`, exact for polynomials of degree
/// `2 points - 1` (Gauss-Hermite; Golub and Welsch, 1969).
pub(crate) fn gauss_hermite(points: usize) -> Vec<(f64, f64)> {
    let jacobi = DMatrix::from_fn(points, points, |i, j| {
        if i.abs_diff(j) == 1 {
            (i.max(j) as f64).sqrt()
        } else {
            0.0
        }
    });
    let eigen = jacobi.symmetric_eigen();
    let mut rule: Vec<(f64, f64)> = (0..points)
        .map(|i| (eigen.eigenvalues[i], eigen.eigenvectors[(0, i)].powi(2)))
        .collect();
    rule.sort_by(|a, b| a.0.total_cmp(&b.0));
    // The rule is symmetric; rounding is not.
    for i in 0..points / 2 {
        let (x, w) = (
            0.5 * (rule[points - 1 - i].0 - rule[i].0),
            0.5 * (rule[i].1 + rule[points - 1 - i].1),
        );
        rule[i] = (-x, w);
        rule[points - 1 - i] = (x, w);
    }
    if points % 2 == 1 {
        rule[points / 2].0 = 0.0;
    }
    rule
}

#[cfg(test)]
mod tests {
    use super::gauss_hermite;

    /// `points` points are exact up to degree `2 points - 1`, and no further.
    #[test]
    fn gauss_hermite_is_exact_as_far_as_it_should_be() {
        for points in 1..=21 {
            let rule = gauss_hermite(points);
            let moment = |degree: i32| rule.iter().map(|(x, w)| w * x.powi(degree)).sum::<f64>();
            // E x^2k = (2k - 1)!!, the odd ones vanish.
            let mut exact = 1.0;
            for k in 0..points as i32 {
                assert!(
                    (moment(2 * k) / exact - 1.0).abs() < 1e-10,
                    "{points} points, degree {}",
                    2 * k
                );
                assert!(moment(2 * k + 1).abs() / exact < 1e-10);
                exact *= f64::from(2 * k + 1);
            }
            // The error of the next one is points!, by the remainder of the rule.
            let factorial: f64 = (1..=points).map(|k| k as f64).product();
            let missing = exact - moment(2 * points as i32);
            assert!(
                (missing / factorial - 1.0).abs() < 1e-3 || points > 12,
                "{points}: {missing}"
            );
            assert!(missing > 0.0);
        }
    }
}
