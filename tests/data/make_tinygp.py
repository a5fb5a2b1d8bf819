"""Writes tinygp.npz: Matern processes by the quasiseparable solver of tinygp.

Usage: `pip install tinygp jax numpy`, then `python tests/data/make_tinygp.py`. Inputs `u`, outputs
`f`, `at`, `length` and `noise` of each problem have the meaning of `test_gp.Problem`. For each
kernel the signal variance is the likeliest one by a dense solve in numpy; mean, deviation and log
likelihood are tinygp's.
"""

from importlib.metadata import version
from pathlib import Path

import jax
import numpy as np
import tinygp

jax.config.update("jax_enable_x64", True)

SHAPES = {
    "matern32": lambda x: (1 + np.sqrt(3) * x) * np.exp(-np.sqrt(3) * x),
    "matern52": lambda x: (1 + np.sqrt(5) * x + 5 / 3 * x**2) * np.exp(-np.sqrt(5) * x),
}


def main() -> None:
    """Computes the processes and writes them beside this script."""
    arrays = {
        "versions": np.array([f"{name} {version(name)}" for name in ("tinygp", "jax", "numpy")])
    }
    for seed, (length, noise) in enumerate([(0.5, 1e-2), (5.0, 1e-4), (50.0, 1e-3)]):
        random = np.random.default_rng(seed)
        # Half of the inputs repeat the one before.
        u = np.cumsum(random.uniform(0, 1, 300) * random.integers(0, 2, 300))
        f = np.column_stack([np.sin(u), 30 * random.normal(size=300)])
        at = np.append(np.linspace(-10, u[-1] + 10, 49), u[::10])
        arrays |= {
            f"{seed}/{name}": np.asarray(value)
            for name, value in {"u": u, "f": f, "at": at, "length": length, "noise": noise}.items()
        }
        for kernel, shape in SHAPES.items():
            k = shape(np.abs(u[:, None] - u) / length) + noise * np.eye(len(u))
            signal = np.sum(f * np.linalg.solve(k, f)) / f.size
            quasisep = getattr(tinygp.kernels.quasisep, kernel.capitalize())
            gp = tinygp.GaussianProcess(
                quasisep(scale=length, sigma=np.sqrt(signal)), u, diag=noise * signal
            )
            conditioned = [gp.condition(column, at, diag=0.0) for column in f.T]
            arrays |= {
                f"{seed}/{kernel}/signal": signal,
                f"{seed}/{kernel}/mean": np.column_stack([one.gp.loc for one in conditioned]),
                f"{seed}/{kernel}/deviation": np.column_stack(
                    [np.sqrt(one.gp.variance) for one in conditioned]
                ),
                f"{seed}/{kernel}/log_likelihood": sum(
                    float(one.log_probability) for one in conditioned
                ),
            }
    np.savez_compressed(Path(__file__).with_name("tinygp.npz"), **arrays)


if __name__ == "__main__":
    main()
