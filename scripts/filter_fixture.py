"""Writes crates/pilotage/tests/fixtures/filter.json: what filterpy's Kalman filter makes of random systems.

    pip install filterpy==2.0.0 numpy
    python scripts/filter_fixture.py > crates/pilotage/tests/fixtures/filter.json

Numbers are written with all their digits. The Rust side of the comparison is tests/filter.rs.
"""

import json
import sys
from importlib.metadata import version

import numpy as np
from filterpy.kalman import KalmanFilter

STEPS = 20
# Variables of the state, readings of the sensor, spectral radius of A.
SYSTEMS = [
    (1, 1, 0.7),
    (1, 1, 1.2),
    (1, 2, 1.0),
    (2, 1, 0.9),
    (2, 1, 1.1),
    (2, 2, 1.0),
    (3, 1, 0.8),
    (3, 2, 1.15),
    (3, 5, 1.05),
    (4, 2, 0.95),
    (4, 4, 1.2),
    (6, 3, 1.1),
]


def covariance(rng, size):
    root = rng.normal(size=(size, size))
    return root @ root.T / size + 0.1 * np.eye(size)


def system(rng, states, readings, radius):
    a = rng.normal(size=(states, states))
    a *= radius / np.abs(np.linalg.eigvals(a)).max()
    return {
        "a": a,
        "b": rng.normal(size=(states, 2)),
        "q": covariance(rng, states),
        "h": rng.normal(size=(readings, states)),
        "r": covariance(rng, readings),
        "mean": rng.normal(size=states),
        "covariance": covariance(rng, states),
    }


def case(rng, states, readings, radius):
    given = system(rng, states, readings, radius)
    kalman = KalmanFilter(dim_x=states, dim_z=readings, dim_u=2)
    kalman.F, kalman.B, kalman.Q = given["a"], given["b"], given["q"]
    kalman.H, kalman.R = given["h"], given["r"]
    kalman.x, kalman.P = given["mean"].reshape(-1, 1), given["covariance"]
    truth = rng.multivariate_normal(given["mean"], given["covariance"])
    steps = []
    for _ in range(STEPS):
        control = rng.normal(size=2)
        truth = given["a"] @ truth + given["b"] @ control
        truth += rng.multivariate_normal(np.zeros(states), given["q"])
        observation = given["h"] @ truth
        observation += rng.multivariate_normal(np.zeros(readings), given["r"])
        kalman.predict(u=control.reshape(-1, 1))
        kalman.update(observation.reshape(-1, 1))
        steps.append(
            {
                "control": control.tolist(),
                "observation": observation.tolist(),
                "mean": kalman.x.ravel().tolist(),
                "covariance": kalman.P.tolist(),
            }
        )
    return {
        "radius": radius,
        **{key: value.tolist() for key, value in given.items()},
        "steps": steps,
    }


def main():
    rng = np.random.default_rng(20130517)
    fixture = {
        "filterpy": version("filterpy"),
        "numpy": version("numpy"),
        "systems": [case(rng, *sizes) for sizes in SYSTEMS],
    }
    json.dump(fixture, sys.stdout, separators=(",", ":"))
    print()


if __name__ == "__main__":
    main()
