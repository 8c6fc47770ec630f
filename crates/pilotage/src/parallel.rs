//! Work on independent items, on all threads with feature `parallel`, always in the same order.

/// `f` of `0..count`, results in order.
#[cfg(feature = "parallel")]
pub fn map<T: Send>(count: usize, f: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    use rayon::prelude::*;
    (0..count).into_par_iter().map(f).collect()
}

/// `f` of `0..count`, results in order.
#[cfg(not(feature = "parallel"))]
pub fn map<T: Send>(count: usize, f: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    (0..count).map(f).collect()
}
