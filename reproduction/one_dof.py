"""Fig. 2: effects of style, goal and time constant on one degree of freedom."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

import pdmp
from pdmp._markdown import markdown_table
from pdmp.plot.canvas import BLUE, GREY, ORANGE, colormap, label_axes, legend, new_figure
from reproduction.metrics import reproduction_error
from reproduction.section import SEED, Section

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

N_DEMOS, N_STYLES = 20, 3
N_SAMPLES = 201
SHARES = np.linspace(0, 1, 7)


@dataclass(frozen=True)
class Example:
    """Demonstrations and model of one kind, and the changes to reproduce them with."""

    title: str
    model: pdmp.Model
    demos: list[pdmp.Demonstration]
    moved: Callable[[pdmp.Conditions], pdmp.Conditions]
    """Changed goal or anchor."""

    def demonstrated(self, m: int) -> tuple[Array, Array]:
        """Returns time [s] and position of a demonstration."""
        span = self.model.durations[m]
        ends = self.model.kind == "discrete"
        return np.linspace(0, span, N_SAMPLES, endpoint=ends), self.demos[m].position[:, 0]

    def error(self, m: int) -> float:
        """Returns the RMSE of the reproduction of a demonstration, over its range."""
        return reproduction_error(self.model, self.demos[m], m)


def discrete(noise: Generator) -> Example:
    """Fits discrete movements that vary by their distance and by two detours."""
    s = np.linspace(0, 1, N_SAMPLES)
    straight = s**3 * (10 - 15 * s + 6 * s**2)
    detour = (4 * s * (1 - s)) ** 3
    shapes = np.column_stack([straight, detour, detour * (1 - 2 * s) * 2])
    weights = noise.normal([1.0, 0.0, 0.0], [0.15, 0.35, 0.45], (N_DEMOS, 3))
    demos = _demos(weights @ shapes.T, noise.uniform(0.8, 1.2, N_DEMOS) / (N_SAMPLES - 1))
    model = pdmp.fit(demos, n_styles=N_STYLES, smoothing=None, transport="immediate")
    return Example("discrete", model, demos, lambda a: a.replace(goal=np.asarray(a.goal) + 0.4))


def rhythmic(noise: Generator) -> Example:
    """Fits cycles that vary by the amplitudes of three waves."""
    phase = 2 * np.pi * np.arange(N_SAMPLES) / N_SAMPLES
    shapes = np.column_stack([np.sin(phase), np.cos(2 * phase), np.sin(3 * phase)])
    weights = noise.normal([1.0, 0.0, 0.0], [0.3, 0.3, 0.2], (N_DEMOS, 3))
    demos = _demos(weights @ shapes.T, noise.uniform(0.8, 1.2, N_DEMOS) / N_SAMPLES)
    model = pdmp.fit(demos, kind="rhythmic", n_styles=N_STYLES, smoothing=None)
    return Example("rhythmic", model, demos, lambda a: a.replace(anchor=np.asarray(a.anchor) + 1.0))


def extremes(model: pdmp.Model) -> tuple[int, int]:
    """Returns the two demonstrations whose styles are the farthest apart."""
    distances = np.linalg.norm(model.styles[:, None] - model.styles, axis=2)
    first, second = np.unravel_index(np.argmax(distances), distances.shape)
    return int(first), int(second)


def figure_2(seed: int = SEED) -> Section:
    """Reproduces Fig. 2."""
    noise = np.random.default_rng(seed)
    examples = [discrete(noise), rhythmic(noise)]
    rows = []
    for example in examples:
        model = example.model
        first, second = extremes(model)
        moved = example.moved(model.conditions(first))
        end = model.rollout(moved, dt=0.001, duration=5.0).position
        missed = np.nan if moved.goal is None else abs(end[-1, 0] - moved.goal[0])
        rows.append(
            [
                example.title,
                f"{model.singular_values[3] / model.singular_values[0]:.1e}",
                f"{example.error(first):.1e}",
                f"{example.error(second):.1e}",
                f"{max(example.error(m) for m in range(N_DEMOS)):.1e}",
                "—" if np.isnan(missed) else f"{missed:.1e}",
            ]
        )
    text = [
        f"{N_DEMOS} demonstrations of each kind, J = {N_STYLES}. Errors are RMSE over the range of "
        "the demonstration.",
        markdown_table(
            [
                "",
                "σ₄/σ₁",
                "error s1",
                "error s2",
                "worst of all",
                "distance after 5 s to a goal 0.4 farther",
            ],
            rows,
        ),
    ]
    return Section("Fig. 2: one degree of freedom", text, {"fig2": draw(examples)})


def draw(examples: Sequence[Example]) -> Figure:
    """Draws demonstrations, reproductions with other goals and tau, and blended styles."""
    figure = new_figure(12.0, 6.8)
    grid = figure.subplots(len(examples), 3)
    for row, example in zip(grid, examples, strict=True):
        model = example.model
        demonstrated, reproduced, between = row
        for m in range(N_DEMOS):
            demonstrated.plot(*example.demonstrated(m), color=GREY, linewidth=0.9)
        for m, color, name in zip(extremes(model), (BLUE, ORANGE), ("s1", "s2"), strict=True):
            _variants(reproduced, example, m, color, name)
        reproduced.plot([], [], color="black", linestyle=":", label="demonstrated")
        reproduced.plot([], [], color="black", linewidth=1.0, label="goal moved")
        reproduced.plot([], [], color="black", linewidth=1.0, linestyle="-.", label="1.5 τ")
        first, second = (model.conditions(m) for m in extremes(model))
        for share in SHARES:
            path = _path(model, pdmp.blend(first, second, float(share)), model.nominal)
            between.plot(path.time, path.position, color=colormap()(share), linewidth=1.3)
        titles = ("demonstrations", "two styles, goals, time constants", "from s1 to s2")
        for axes, title in zip(row, titles, strict=True):
            label_axes(axes, "time [s]", "position [–]", f"{example.title}: {title}")
    legend(grid[0, 1])
    return figure


def _variants(axes: Axes, example: Example, m: int, color: str, name: str) -> None:
    """Draws a demonstration, its reproduction, and the reproduction with changed goal and tau."""
    model = example.model
    own = model.conditions(m)
    tau = model.tau * float(model.durations[m] / model.durations[model.nominal])
    for conditions, width, line, slower in (
        (own, 3.0, "-", 1.0),
        (example.moved(own), 1.0, "-", 1.0),
        (own.replace(tau=1.5 * tau), 1.0, "-.", 1.5),
    ):
        path = _path(model, conditions, m, slower)
        label = name if conditions is own else None
        axes.plot(
            path.time, path.position, color=color, linewidth=width, linestyle=line, label=label
        )
    time, position = example.demonstrated(m)
    for period in range(_n_periods(model)):
        shifted = time + period * model.durations[m]
        axes.plot(shifted, position, color="black", linestyle=":", linewidth=1.3, zorder=3)


def _path(
    model: pdmp.Model, conditions: pdmp.Conditions, m: int, slower: float = 1.0
) -> pdmp.Trajectory:
    """Returns a rollout somewhat longer than a demonstration, or of two cycles."""
    span = 1.2 * _n_periods(model) * model.durations[m] * slower
    return model.rollout(conditions, dt=0.002, duration=span)


def _n_periods(model: pdmp.Model) -> int:
    return 1 if model.kind == "discrete" else 2


def _demos(positions: Array, intervals: Array) -> list[pdmp.Demonstration]:
    """Returns demonstrations of one degree of freedom from the rows of (M, N_SAMPLES)."""
    pairs = zip(positions, intervals, strict=True)
    return [pdmp.Demonstration(position[:, None], dt=dt) for position, dt in pairs]
