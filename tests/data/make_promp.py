"""Writes promp.npz: weights of probabilistic movement primitives by movement_primitives.

Usage: `pip install movement_primitives numpy`, then `python tests/data/make_promp.py`. `sampled`
(M, C, D) are movements that are linear in their `heights`, `weights` (M, K) the library's for them,
`trajectories` (K, C, D) those for each unit weight. `forecasts` are trajectories of
the library for weights at the heights `at`, linear in the height by least squares in numpy.
"""

from importlib.metadata import version
from pathlib import Path

import numpy as np
from movement_primitives.promp import ProMP


def main() -> None:
    """Computes the weights and writes them beside this script."""
    heights, at = np.linspace(0, 0.5, 6), np.array([0.23, 0.7])
    s = np.linspace(0, 1, 101)
    reach, arch = s**3 * (10 - 15 * s + 6 * s**2), 64 * (s * (1 - s)) ** 3
    sampled = np.array([np.column_stack([(1 + h) * reach + h, h * arch]) for h in heights])
    promp = ProMP(n_dims=2, n_weights_per_dim=20)
    weights = np.array([promp.weights(s, movement) for movement in sampled])
    line = np.linalg.lstsq(np.column_stack([np.ones(6), heights]), weights, rcond=None)[0]
    predicted = np.column_stack([np.ones(len(at)), at]) @ line
    np.savez_compressed(
        Path(__file__).with_name("promp.npz"),
        versions=[f"{name} {version(name)}" for name in ("movement_primitives", "numpy")],
        heights=heights,
        at=at,
        sampled=sampled,
        weights=weights,
        trajectories=[promp.trajectory_from_weights(s, unit) for unit in np.eye(40)],
        forecasts=[promp.trajectory_from_weights(s, one) for one in predicted],
    )


if __name__ == "__main__":
    main()
