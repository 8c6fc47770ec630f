//! Fewer Gaussians: the hopeless are dropped, those most alike merged so that moments stay.

use super::component::{Component, root};

/// Components of less weight are dropped.
const HOPELESS: f64 = 1e-6;

/// Components are merged where that costs less than this, in nats times weight.
const ALIKE: f64 = 1e-5;

/// Makes a sum of at most `most` components, its weights summing to 1. `floors` are standard deviations that count as none, length `n`.
///
/// What a merger costs is bounded by how much it raises the entropy (A. Runnalls, 2007).
pub(super) fn reduce(components: &mut Vec<Component>, most: usize, floors: &[f64]) {
    normalise(components);
    let heaviest = components
        .iter()
        .fold(0.0, |most: f64, c| most.max(c.weight));
    components.retain(|component| component.weight >= HOPELESS.min(heaviest));
    let n = floors.len();
    // Along a line, only neighbours can be most alike.
    let line = n == 1;
    components.sort_by(|a, b| a.mode.cmp(&b.mode).then(a.mean[0].total_cmp(&b.mean[0])));
    let mut sizes: Vec<f64> = components.iter().map(|c| size(c, floors)).collect();
    // Along a line only neighbours can be most alike; elsewhere each is compared with all after it.
    let partners = |i: usize, count: usize| i + 1..if line { (i + 2).min(count) } else { count };
    let nearest = |i: usize, components: &[Component], sizes: &[f64]| {
        let own = |j: &usize| components[*j].mode == components[i].mode;
        let partners = partners(i, components.len()).take_while(own);
        let costs = partners.map(|j| {
            let sizes = (sizes[i], sizes[j]);
            (cost(&components[i], &components[j], sizes, floors), j)
        });
        costs.fold(
            (f64::INFINITY, i),
            |best, one| if one.0 < best.0 { one } else { best },
        )
    };
    let mut best: Vec<(f64, usize)> = (0..components.len())
        .map(|i| nearest(i, components, &sizes))
        .collect();
    while components.len() > 1 {
        let least = (0..best.len()).fold(
            0,
            |least, i| if best[i].0 < best[least].0 { i } else { least },
        );
        let (cost, other) = best[least];
        if !cost.is_finite() || (components.len() <= most && cost >= ALIKE) {
            break;
        }
        let taken = components.remove(other);
        sizes.remove(other);
        best.remove(other);
        merge(&mut components[least], &taken);
        sizes[least] = size(&components[least], floors);
        for (i, entry) in best.iter_mut().enumerate() {
            let stale = i == least
                || entry.1 == least
                || entry.1 == other
                || partners(i, components.len()).contains(&least);
            if stale {
                *entry = nearest(i, components, &sizes);
            } else if entry.1 > other {
                entry.1 -= 1;
            }
        }
    }
    normalise(components);
}

/// Makes weights sum to 1.
pub(super) fn normalise(components: &mut [Component]) {
    let total: f64 = components.iter().map(|component| component.weight).sum();
    if total > 0.0 {
        for component in components {
            component.weight /= total;
        }
    }
}

/// Takes another component in, so that weight, mean and covariance are those of both.
pub(super) fn merge(one: &mut Component, other: &Component) {
    let n = one.mean.len();
    let total = one.weight + other.weight;
    if total <= 0.0 {
        return;
    }
    let (a, b) = (one.weight / total, other.weight / total);
    let apart: Vec<f64> = other
        .mean
        .iter()
        .zip(&one.mean)
        .map(|(x, y)| x - y)
        .collect();
    for i in 0..n {
        for j in 0..n {
            let k = i * n + j;
            one.covariance[k] =
                a * one.covariance[k] + b * other.covariance[k] + a * b * apart[i] * apart[j];
        }
    }
    for (mean, apart) in one.mean.iter_mut().zip(&apart) {
        *mean += b * apart;
    }
    one.weight = total;
}

/// How much merging raises the entropy at most.
fn cost(one: &Component, other: &Component, sizes: (f64, f64), floors: &[f64]) -> f64 {
    let total = one.weight + other.weight;
    let merged = match floors.len() {
        1 => {
            let (a, b) = (one.weight / total, other.weight / total);
            let apart = one.mean[0] - other.mean[0];
            let within = a * one.covariance[0] + b * other.covariance[0];
            (within + a * b * apart * apart + floors[0] * floors[0]).ln()
        }
        2 => {
            let (a, b) = (one.weight / total, other.weight / total);
            let apart = [0, 1].map(|i: usize| one.mean[i] - other.mean[i]);
            let entry = |i: usize, j: usize| {
                let k = 2 * i + j;
                let own = a * one.covariance[k] + b * other.covariance[k];
                let floor = if i == j { floors[i] * floors[i] } else { 0.0 };
                own + a * b * apart[i] * apart[j] + floor
            };
            let size = entry(0, 0) * entry(1, 1) - entry(0, 1) * entry(1, 0);
            size.max(f64::MIN_POSITIVE).ln()
        }
        _ => {
            let mut both = one.clone();
            merge(&mut both, other);
            size(&both, floors)
        }
    };
    0.5 * (total * merged - one.weight * sizes.0 - other.weight * sizes.1)
}

/// Logarithm of the determinant of the covariance, with the floors added.
fn size(component: &Component, floors: &[f64]) -> f64 {
    let n = floors.len();
    let at = |i: usize, j: usize| {
        component.covariance[i * n + j] + if i == j { floors[i] * floors[i] } else { 0.0 }
    };
    match n {
        1 => at(0, 0).ln(),
        2 => (at(0, 0) * at(1, 1) - at(0, 1) * at(1, 0))
            .max(f64::MIN_POSITIVE)
            .ln(),
        _ => {
            let lifted: Vec<f64> = (0..n * n).map(|k| at(k / n, k % n)).collect();
            let root = root(&lifted, n);
            let pivots = (0..n).map(|i| root[i * n + i].max(floors[i]));
            2.0 * pivots.map(f64::ln).sum::<f64>()
        }
    }
}
