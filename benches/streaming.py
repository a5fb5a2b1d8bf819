"""Fits of up to a million demonstrations in blocks: time by stage, memory, and other libraries.

``make bench-streaming`` runs this for `SIZES`, and draws docs/streaming.png; arguments are other
numbers of demonstrations. Each fit runs in a process of its own, whose largest memory beside a
block is reported. Times are those of the processor, summed over threads, without the generation of
the blocks in every pass; BLAS has one thread, since its idle ones would count. The other libraries
compute five factors of the positions of the same blocks, without alignment, targets or a model.
"""

import os
import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter, process_time, thread_time

import numpy as np

import pdmp
from pdmp.plot.canvas import MARKERS, PALETTE, label_axes, new_figure

SIZES = [1000, 3162, 10_000, 31_623, 100_000]  # M
MAX_OTHERS = 100_000  # M of the other libraries
NOISE = 1e-3  # standard deviation of that of noisy recordings
BLOCK = 2000  # demonstrations
N_SAMPLES, N_DOFS, N_FACTORS = 200, 7, 5
NAMES = {
    "pdmp": "pdmp, the whole fit",
    "noisy": "pdmp, recordings with noise",
    "dask": "dask, svd_compressed",
    "sklearn": "scikit-learn, IncrementalPCA",
}
STAGES = ("first pass", "factors", "styles", "finish")


class Library:
    """Generator of reaches with twelve factors of variation, start and goal, and noise."""

    def __init__(self, n_demos: int, noise: float = 0.0) -> None:
        self.n_demos, self.noise = n_demos, noise
        self.seconds: list[float] = []  # of the processor, by block
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
        start = thread_time()
        size = min(BLOCK, self.n_demos - k * BLOCK)
        rng = np.random.default_rng(k)
        weights = rng.normal(size=(size, len(self.curves)))
        positions = (weights @ self.curves).reshape(size, N_SAMPLES, N_DOFS)
        if self.noise:
            positions += rng.normal(0, self.noise, positions.shape)
        self.seconds.append(thread_time() - start)
        return positions

    def blocks(self) -> Iterator[np.ndarray]:
        """Yields all blocks."""
        for k in range(self.n_blocks):
            yield self.block(k)


class Stopwatch:
    """Processor seconds of all threads by stage, without those of the generation of blocks."""

    def __init__(self, library: Library) -> None:
        library.block(0)
        self.library = library
        self.seconds: dict[str, float] = {}
        self.start()

    def now(self) -> float:
        """Returns the seconds so far."""
        return process_time() - sum(self.library.seconds)

    def start(self) -> None:
        """Begins a stage."""
        self.began = self.now()

    def stop(self, stage: str) -> None:
        """Ends a stage, and begins another."""
        now = self.now()
        self.seconds[stage], self.began = now - self.began, now


def fit(library: Library, watch: Stopwatch) -> None:
    """Fits a model in the stages of `pdmp.fit`."""
    partial = pdmp.PartialFit(library.block(0), dt=0.01).empty()
    for block in library.blocks():
        partial.update(block)
    watch.stop("first pass")
    factorised = partial.factorise(n_styles=N_FACTORS)
    watch.stop("factors")
    del partial
    projection = factorised.projection
    styles = [projection.styles(block, k * BLOCK) for k, block in enumerate(library.blocks())]
    watch.stop("styles")
    model = factorised.finish(styles)
    watch.stop("finish")
    assert model.n_demos == library.n_demos


def dask_factors(library: Library, watch: Stopwatch) -> None:
    """Computes dask's randomised factors."""
    import dask.array

    watch.start()

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
    factors = dask.array.linalg.svd_compressed(
        dask.array.concatenate(arrays), N_FACTORS, n_power_iter=1, seed=0
    )
    dask.compute(*factors)
    watch.stop("factors")


def incremental_components(library: Library, watch: Stopwatch) -> None:
    """Computes scikit-learn's incremental principal components, and the styles."""
    from sklearn.decomposition import IncrementalPCA

    watch.start()
    pca = IncrementalPCA(N_FACTORS)
    for block in library.blocks():
        pca.partial_fit(block.reshape(len(block), -1))
    watch.stop("first pass")
    for block in library.blocks():
        pca.transform(block.reshape(len(block), -1))
    watch.stop("styles")


METHODS = {"pdmp": fit, "noisy": fit, "dask": dask_factors, "sklearn": incremental_components}


def report(method: str, n_demos: int) -> None:
    """Prints the times and the memory of a method, as numbers."""
    library = Library(n_demos, NOISE if method == "noisy" else 0.0)
    watch = Stopwatch(library)
    before, start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, perf_counter()
    METHODS[method](library, watch)
    memory = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    stages = [watch.seconds.get(stage, 0.0) for stage in STAGES]
    print(method, n_demos, perf_counter() - start, memory, *stages, flush=True)


def measure(method: str, n_demos: int) -> list[float]:
    """Returns time on the clock [s], memory [MB] and seconds by stage, of a process of its own."""
    command = [sys.executable, __file__, method, str(n_demos)]
    settings = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    run = subprocess.run(command, check=True, capture_output=True, text=True, env=settings)
    return [float(number) for number in run.stdout.split()[2:]]


def draw(results: dict[tuple[str, int], list[float]]) -> None:
    """Draws processor time and memory over the number of demonstrations."""
    figure = new_figure(9, 3.6)
    left, right = figure.subplots(1, 2)
    label_axes(left, "demonstrations M", "processor time [s]")
    label_axes(right, "demonstrations M", "memory beside a block [MB]")
    for index, (method, name) in enumerate(NAMES.items()):
        sizes = [size for other, size in results if other == method]
        rows = [results[method, size] for size in sizes]
        style = {"marker": MARKERS[index], "color": PALETTE[index], "markersize": 4}
        left.loglog(sizes, [sum(row[2:]) for row in rows], label=name, **style)
        right.loglog(sizes, [row[1] for row in rows], **style)
    left.legend(frameon=False)
    figure.savefig(Path(__file__).parents[1] / "docs" / "streaming.png")


def main(sizes: list[int]) -> None:
    """Prints the table, and draws the figure if several sizes have been measured."""
    columns = ["processor time [s]", *STAGES, "demonstrations/s", "memory [MB]", "clock [s]"]
    print("| M | | " + " | ".join(columns) + " |\n|--:|---|" + "--:|" * len(columns))
    results = {}
    for size in sizes:
        for method, name in NAMES.items():
            if method in ("dask", "sklearn") and size > MAX_OTHERS:
                continue
            results[method, size] = [wall, memory, *stages] = measure(method, size)
            total = sum(stages)
            of_stages = [f"{stage:.1f}" if stage else "" for stage in stages]
            row = [str(size), name, f"{total:.1f}", *of_stages, f"{size / total:.0f}"]
            print("| " + " | ".join([*row, f"{memory:.0f}", f"{wall:.0f}"]) + " |", flush=True)
        if len(results) > len(NAMES):
            draw(results)


if __name__ == "__main__":
    if sys.argv[1:2] and sys.argv[1] in METHODS:
        report(sys.argv[1], int(sys.argv[2]))
    else:
        main([int(argument) for argument in sys.argv[1:]] or SIZES)
