"""Fits of up to a million demonstrations in blocks: time by stage, memory, and other libraries.

``make bench-streaming`` runs this for `SIZES`; arguments are other numbers of demonstrations. Each
fit runs in a process of its own, whose largest memory is reported. Blocks are generated as they are
read, in every pass. The other libraries compute five factors of the positions of the same blocks,
without alignment, targets or a model.
"""

import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter

import numpy as np

import pdmp

SIZES = [1000, 3162, 10_000, 31_623, 100_000]  # M
BLOCK = 2000  # demonstrations
N_SAMPLES, N_DOFS, N_FACTORS = 200, 7, 5
METHODS = ("pdmp", "dask", "sklearn")


class Library:
    """Generator of reaches with twelve factors of variation, start and goal."""

    def __init__(self, n_demos: int) -> None:
        self.n_demos = n_demos
        self.seconds = 0.0
        s = np.linspace(0, 1, N_SAMPLES)[:, None]
        rise = s**3 * (10 - 15 * s + 6 * s**2)
        waves = (s * (1 - s)) ** 2 * np.sin(np.pi * s * np.arange(1, 13)) * 16 / np.arange(1, 13)
        joints = np.random.default_rng(0).normal(size=(12, N_DOFS))
        self.curves = np.concatenate(
            [
                (rise[:, :, None] * np.eye(N_DOFS)).transpose(1, 0, 2),
                ((1 - rise)[:, :, None] * np.eye(N_DOFS)).transpose(1, 0, 2),
                waves.T[:, :, None] * joints[:, None],
            ]
        ).reshape(-1, N_SAMPLES * N_DOFS)

    @property
    def n_blocks(self) -> int:
        """Number of blocks."""
        return -(-self.n_demos // BLOCK)

    def block(self, k: int) -> np.ndarray:
        """Returns block k as an array (B, T, D)."""
        start = perf_counter()
        size = min(BLOCK, self.n_demos - k * BLOCK)
        weights = np.random.default_rng(k).normal(size=(size, len(self.curves)))
        positions = (weights @ self.curves).reshape(size, N_SAMPLES, N_DOFS)
        self.seconds += perf_counter() - start
        return positions

    def blocks(self) -> Iterator[np.ndarray]:
        """Yields all blocks."""
        for k in range(self.n_blocks):
            yield self.block(k)


def fit(library: Library) -> dict[str, float]:
    """Returns the seconds of each stage of a fit."""
    seconds = {}
    start = perf_counter()
    partial = pdmp.PartialFit(library.block(0), dt=0.01).empty()
    for block in library.blocks():
        partial.update(block)
    seconds["first pass"] = perf_counter() - start - library.seconds
    start = perf_counter()
    factorised = partial.factorise(n_styles=N_FACTORS)
    seconds["factors"] = perf_counter() - start
    del partial
    generated = library.seconds
    start = perf_counter()
    projection = factorised.projection
    styles = [projection.styles(block, k * BLOCK) for k, block in enumerate(library.blocks())]
    seconds["styles"] = perf_counter() - start - (library.seconds - generated)
    start = perf_counter()
    model = factorised.finish(styles)
    seconds["finish"] = perf_counter() - start
    assert model.n_demos == library.n_demos
    return seconds


def dask_factors(library: Library) -> dict[str, float]:
    """Returns the seconds of dask's randomised factors."""
    import dask.array

    def rows(k: int) -> np.ndarray:
        return library.block(k).reshape(-1, N_SAMPLES * N_DOFS)

    arrays = [
        dask.array.from_delayed(
            dask.delayed(rows)(k),
            (min(BLOCK, library.n_demos - k * BLOCK), N_SAMPLES * N_DOFS),
            float,
        )
        for k in range(library.n_blocks)
    ]
    start = perf_counter()
    factors = dask.array.linalg.svd_compressed(
        dask.array.concatenate(arrays), N_FACTORS, n_power_iter=1, seed=0
    )
    dask.compute(*factors)
    return {"total": perf_counter() - start - library.seconds}


def incremental_components(library: Library) -> dict[str, float]:
    """Returns the seconds of scikit-learn's incremental principal components."""
    from sklearn.decomposition import IncrementalPCA

    pca = IncrementalPCA(N_FACTORS)
    start = perf_counter()
    for block in library.blocks():
        pca.partial_fit(block.reshape(len(block), -1))
    for block in library.blocks():
        pca.transform(block.reshape(len(block), -1))
    return {"total": perf_counter() - start - library.seconds}


def report(method: str, n_demos: int) -> None:
    """Prints time and memory of a method."""
    run = {"pdmp": fit, "dask": dask_factors, "sklearn": incremental_components}[method]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    library = Library(n_demos)
    start = perf_counter()
    seconds = run(library)
    total = perf_counter() - start
    memory = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    stages = ", ".join(f"{stage} {time:.1f}" for stage, time in seconds.items())
    rate = n_demos / sum(seconds.values())
    print(
        f"{method:8} {n_demos:8} {total:8.1f} s = generation {library.seconds:.1f}, {stages};"
        f" {rate:8.0f}/s, {memory:6.0f} MB",
        flush=True,
    )


if __name__ == "__main__":
    if sys.argv[1:2] and sys.argv[1] in METHODS:
        report(sys.argv[1], int(sys.argv[2]))
    else:
        for size in [int(argument) for argument in sys.argv[1:]] or SIZES:
            for method in METHODS:
                subprocess.run([sys.executable, Path(__file__), method, str(size)], check=True)
