"""Scaling of the time to learn: Gaussian processes with samples, factors with demonstrations.

``make bench-scaling`` runs this and draws docs/scaling.png.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import perf_counter

import numpy as np
from matplotlib.axes import Axes
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import Matern

import pdmp
from pdmp.plot.canvas import MARKERS, PALETTE, label_axes, new_figure
from peers.factors import library
from peers.regression import LENGTH, NOISE, samples

MAX_TIME = 2.0  # s: longer times are left out
REPEATS = 5
SIZES = [round(10 ** (exponent / 4)) for exponent in range(6, 21)]  # C, 32 to 100 000
LIBRARIES = [round(10 ** (exponent / 4)) for exponent in range(2, 15)]  # M, 3 to 3162
N_VALUES = 7000  # C·D

Call = Callable[[], object]


def process(**hyperparameters: float) -> Callable[[int], Call]:
    """Returns a function of the number of samples that fits a process with three outputs."""
    return lambda count: partial(pdmp.GP("matern52", **hyperparameters).regress, *samples(count))


def dense(count: int) -> Call:
    """Fits a process of scikit-learn with given hyperparameters."""
    u, f = samples(count)
    gp = GaussianProcessRegressor(Matern(LENGTH, nu=2.5), alpha=NOISE, optimizer=None)
    return partial(gp.fit, u[:, None], f)


def leading(n_demos: int) -> Call:
    """Computes the five leading factors."""
    return partial(pdmp.factorise, library(n_demos, N_VALUES), n_styles=min(5, n_demos))


def every(n_demos: int) -> Call:
    """Computes all factors."""
    return partial(pdmp.factorise, library(n_demos, N_VALUES), n_styles=n_demos)


def lapack(n_demos: int) -> Call:
    """Computes all factors with numpy."""
    return partial(np.linalg.svd, library(n_demos, N_VALUES), full_matrices=False)


def times(method: Callable[[int], Call], sizes: list[int]) -> dict[int, float]:
    """Returns the minimum time [s] by size, until one exceeds `MAX_TIME`."""
    seconds: dict[int, float] = {}
    for size in sizes:
        call = method(size)
        seconds[size] = min(timed(call) for _ in range(REPEATS))
        if seconds[size] > MAX_TIME:
            break
    return seconds


def timed(call: Call) -> float:
    """Returns the time of one call [s]."""
    begin = perf_counter()
    call()
    return perf_counter() - begin


def panel(
    axes: Axes, title: str, methods: dict[str, Callable[[int], Call]], sizes: list[int], over: str
) -> None:
    """Draws the times of several methods over the size of the problem, and prints them."""
    label_axes(axes, over, "time [s]")
    print(title)
    for index, (name, method) in enumerate(methods.items()):
        seconds = times(method, sizes)
        style = {"marker": MARKERS[index], "color": PALETTE[index], "markersize": 4}
        axes.loglog(list(seconds), list(seconds.values()), label=name, **style)
        print(f"{name}: " + ", ".join(f"{size}: {1e3 * t:.3g} ms" for size, t in seconds.items()))
    location = {"loc": "lower left", "bbox_to_anchor": (0, 1), "alignment": "left"}
    axes.legend(title=title, title_fontsize="large", frameon=False, **location)


def main() -> None:
    """Measures the times and draws the figure."""
    processes = {
        "pdmp, hyperparameters given": process(length=LENGTH, noise=NOISE),
        "pdmp, with hyperparameters": process(),
        "scikit-learn, hyperparameters given": dense,
    }
    factors = {
        "pdmp, five leading factors": leading,
        "pdmp, all factors": every,
        "numpy, all factors": lapack,
    }
    figure = new_figure(9, 4.2)
    left, right = figure.subplots(1, 2)
    title = "Gaussian process, Matérn-5/2, three outputs"
    panel(left, title, processes, SIZES, "samples C")
    title = f"Factors of targets (M, {N_VALUES})"
    panel(right, title, factors, LIBRARIES, "demonstrations M")
    figure.savefig(Path(__file__).parents[1] / "docs" / "scaling.png")


if __name__ == "__main__":
    main()
