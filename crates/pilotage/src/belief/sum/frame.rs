//! A Gaussian seen from within: its own standard normal coordinates, of which a singular one has fewer than there are variables.

use smallvec::{SmallVec, smallvec};

use super::component::Component;

/// Numbers of a Gaussian in few variables, which need no room elsewhere.
pub(super) type Few = SmallVec<[f64; 9]>;

/// `x = mean + root z` with `z` of length `r`, standard normal.
pub(super) struct Frame {
    mean: Few,
    /// `n x r`, row by row.
    root: Few,
    /// Number of directions in which there is any variance, `r`.
    pub(super) rank: usize,
}

/// A Gaussian in the coordinates of a frame.
#[derive(Clone)]
pub(super) struct Inner {
    /// Length `r`.
    pub(super) mean: Few,
    /// `r x r`, row by row.
    pub(super) covariance: Few,
}

impl Inner {
    /// The standard normal of so many coordinates.
    pub(super) fn standard(r: usize) -> Self {
        let one = |k: usize| f64::from(k.is_multiple_of(r + 1));
        Self {
            mean: smallvec![0.0; r],
            covariance: (0..r * r).map(one).collect(),
        }
    }
}

impl Frame {
    pub(super) fn new(component: &Component) -> Self {
        let n = component.dim();
        let whole = root(&component.covariance, n);
        let kept: SmallVec<[usize; 3]> = (0..n).filter(|&j| whole[j * n + j] > 0.0).collect();
        let rank = kept.len();
        let root = match rank == n {
            true => whole,
            false => (0..n * rank)
                .map(|k| whole[k / rank * n + kept[k % rank]])
                .collect(),
        };
        Self {
            mean: Few::from_slice(&component.mean),
            root,
            rank,
        }
    }

    /// Number of state variables, `n`.
    pub(super) fn dim(&self) -> usize {
        self.mean.len()
    }

    /// Writes the state at `z`.
    pub(super) fn place(&self, z: &[f64], to: &mut [f64]) {
        // Loops whose lengths are known are unrolled.
        match (self.rank, self.mean.as_slice()) {
            (0, mean) => to.copy_from_slice(mean),
            (1, &[_]) => self.place_in(1, z, &mut to[..1]),
            (2, &[_, _]) => self.place_in(2, z, &mut to[..2]),
            (rank, _) => self.place_in(rank, z, to),
        }
    }

    #[inline(always)]
    fn place_in(&self, rank: usize, z: &[f64], to: &mut [f64]) {
        let rows = self.root.chunks_exact(rank);
        for ((value, mean), row) in to.iter_mut().zip(&self.mean).zip(rows) {
            *value = mean + row.iter().zip(&z[..rank]).map(|(a, z)| a * z).sum::<f64>();
        }
    }

    /// A linear function of states, `m x n` row by row, as one of these coordinates, `m x r`: `H root`.
    pub(super) fn seen(&self, h: &[f64]) -> Few {
        let (n, r) = (self.dim(), self.rank);
        let entry = |k: usize| {
            let (q, i) = (k / r, k % r);
            (0..n).map(|j| h[q * n + j] * self.root[j * r + i]).sum()
        };
        (0..h.len() / n * r).map(entry).collect()
    }

    /// What it is in the middle, length `m`: `H mean`.
    pub(super) fn middle_seen(&self, h: &[f64]) -> Few {
        let rows = h.chunks_exact(self.dim());
        rows.map(|row| row.iter().zip(&self.mean).map(|(h, x)| h * x).sum())
            .collect()
    }

    /// Gives a component the moments of a Gaussian in these coordinates.
    pub(super) fn write(&self, inner: &Inner, component: &mut Component) {
        let (n, r) = (self.mean.len(), self.rank);
        self.place(&inner.mean, &mut component.mean);
        for i in 0..n {
            for j in 0..=i {
                let mut sum = 0.0;
                for k in 0..r {
                    for l in 0..r {
                        sum += self.root[i * r + k]
                            * inner.covariance[k * r + l]
                            * self.root[j * r + l];
                    }
                }
                component.covariance[i * n + j] = sum;
                component.covariance[j * n + i] = sum;
            }
            component.covariance[i * n + i] = component.covariance[i * n + i].max(0.0);
        }
    }
}

/// Lower triangular root of a covariance, row by row; 0 along directions without any variance.
pub(super) fn root(covariance: &[f64], n: usize) -> Few {
    let mut root: Few = smallvec![0.0; n * n];
    root_into(covariance, n, &mut root);
    root
}

/// The same, with room for it.
pub(super) fn root_into(covariance: &[f64], n: usize, root: &mut [f64]) {
    // Loops whose lengths are known are unrolled.
    match n {
        1 => root_of(covariance, 1, root),
        2 => root_of(covariance, 2, root),
        3 => root_of(covariance, 3, root),
        _ => root_of(covariance, n, root),
    }
}

#[inline(always)]
fn root_of(covariance: &[f64], n: usize, root: &mut [f64]) {
    let (covariance, root) = (&covariance[..n * n], &mut root[..n * n]);
    root.fill(0.0);
    let scale = (0..n).fold(0.0, |most: f64, i| most.max(covariance[i * n + i]));
    for j in 0..n {
        let before: f64 = (0..j).map(|k| root[j * n + k] * root[j * n + k]).sum();
        let pivot = covariance[j * n + j] - before;
        // What is left of a variance in rounding is none.
        if pivot <= 1e-14 * covariance[j * n + j] || pivot <= 1e-30 * scale || pivot <= 0.0 {
            continue;
        }
        let pivot = pivot.sqrt();
        root[j * n + j] = pivot;
        for i in j + 1..n {
            let shared: f64 = (0..j).map(|k| root[i * n + k] * root[j * n + k]).sum();
            root[i * n + j] = (covariance[i * n + j] - shared) / pivot;
        }
    }
}

/// Writes `mean + root z` for a lower triangular root.
pub(super) fn place(mean: &[f64], root: &[f64], z: &[f64], to: &mut [f64]) {
    match mean.len() {
        1 => place_of(mean, root, 1, z, to),
        2 => place_of(mean, root, 2, z, to),
        n => place_of(mean, root, n, z, to),
    }
}

#[inline(always)]
fn place_of(mean: &[f64], root: &[f64], n: usize, z: &[f64], to: &mut [f64]) {
    let (mean, root) = (&mean[..n], &root[..n * n]);
    let (z, to) = (&z[..n], &mut to[..n]);
    for i in 0..n {
        to[i] = mean[i] + (0..=i).map(|k| root[i * n + k] * z[k]).sum::<f64>();
    }
}

/// Turns `x` into `L^-1 x` for the root `L` of a covariance; returns the logarithm of its density under N(0, L L'). Directions without
/// variance are left out.
pub(super) fn whiten(root: &[f64], x: &mut [f64]) -> f64 {
    match x.len() {
        1 => whiten_of(root, 1, x),
        2 => whiten_of(root, 2, x),
        3 => whiten_of(root, 3, x),
        n => whiten_of(root, n, x),
    }
}

#[inline(always)]
fn whiten_of(root: &[f64], n: usize, x: &mut [f64]) -> f64 {
    let (root, x) = (&root[..n * n], &mut x[..n]);
    let (mut log, mut volume) = (0.0, 1.0_f64);
    for i in 0..n {
        let before: f64 = (0..i).map(|k| root[i * n + k] * x[k]).sum();
        let pivot = root[i * n + i];
        if pivot > 0.0 {
            x[i] = (x[i] - before) / pivot;
            log -= 0.5 * (LOG_TAU + x[i] * x[i]);
            volume *= pivot;
            if !SAFE.contains(&volume) {
                log -= volume.ln();
                volume = 1.0;
            }
        } else {
            x[i] = 0.0;
        }
    }
    log - volume.ln()
}

/// Volumes of which the logarithm need not be taken yet: one for all pivots is faster than one for each.
pub(super) const SAFE: std::ops::Range<f64> = 1e-100..1e100;

/// `ln 2 pi`.
pub(super) const LOG_TAU: f64 = 1.837_877_066_409_345_3;
