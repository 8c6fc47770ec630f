//! Random numbers: one seed gives independent streams by episode and role, so that results do not depend on the
//! number of threads, and world, sensor and exploration never share draws.

use chacha20::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

/// The generator every random draw comes from.
pub type Rng = ChaCha8Rng;

/// Who draws from a stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// True start and motion noise.
    World = 0,
    /// Measurement noise.
    Sensor = 1,
    /// Choice of actions while learning.
    Exploration = 2,
    /// Rollouts inside a planner.
    Planner = 3,
}

const ROLES: u64 = 4;

/// The stream of one role in one episode.
pub fn stream(seed: u64, episode: u64, role: Role) -> Rng {
    let mut rng = Rng::seed_from_u64(seed);
    rng.set_stream(episode.wrapping_mul(ROLES).wrapping_add(role as u64));
    rng
}

/// A stream that goes on as another does.
pub(crate) fn fork(rng: &Rng) -> Rng {
    Rng::deserialize_state(&rng.serialize_state())
}

/// A draw from N(0, 1).
pub fn normal(rng: &mut Rng) -> f64 {
    rng.sample(StandardNormal)
}

/// A draw from U[0, 1).
pub fn uniform(rng: &mut Rng) -> f64 {
    rng.random()
}
