"""Fits one primitive to five handwritten shapes; writes model, figures and a report.

example: python -m reproduction.demo -o out/demo
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter, perf_counter_ns
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import pdmp
from pdmp import plot
from pdmp._markdown import markdown_table
from pdmp.cli.progress import progress
from pdmp.datasets import handwriting
from pdmp.plot.canvas import BLUE, GREY, ORANGE, draw_movement, figure_of, legend, movement_panels
from reproduction import command
from reproduction.metrics import reproduction_error
from reproduction.section import Section

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHAPES = ("CShape", "GShape", "NShape", "Sshape", "WShape")
BLENDED = ("CShape", "Sshape")
RUN, RESTYLED = "NShape", "WShape"
GOAL_SHIFT = np.array([10.0, 15.0])  # mm
DT = 0.001  # s


def main(argv: Sequence[str] | None = None) -> int:
    """Runs `python -m reproduction.demo` and returns its exit code."""
    parser = command.parser("reproduction.demo", __doc__, output="out/demo")
    folder = Path(parser.parse_args(argv).output)

    def make_report() -> str:
        folder.mkdir(parents=True, exist_ok=True)
        with progress() as show:
            return demonstrate(folder, show).write(folder, "report")

    return command.run(make_report)


def demonstrate(folder: Path, progress: Callable[[str, float], object]) -> Section:
    """Fits one primitive to the shapes, writes the model into a folder, and returns the report."""
    times: dict[str, float] = {}
    with timed(times, "read 35 recordings"):
        recordings = handwriting(SHAPES)
    demos = [demo for shape in SHAPES for demo in recordings[shape]]
    labels = [shape for shape in SHAPES for _ in recordings[shape]]
    with timed(times, "learn, J by the singular values"):
        model = pdmp.fit(demos, progress=progress)
    with timed(times, "learn, J = M"):
        model_of_all = pdmp.fit(demos, n_styles=len(demos), progress=progress)
    with timed(times, "save and load"):
        model.save(folder / "model.safetensors")
        model = pdmp.load(folder / "model.safetensors")

    members = {shape: [m for m, label in enumerate(labels) if label == shape] for shape in SHAPES}
    means = {shape: model.conditions(members[shape]) for shape in SHAPES}
    here, there = (means[shape] for shape in BLENDED)
    with timed(times, "roll out half way, 1 kHz"):
        model.rollout(pdmp.blend(here, there, 0.5), dt=DT)
    commands = {
        "goal moved": {"goal": means[RUN].goal + GOAL_SHIFT},
        f"style switched to {RESTYLED}": {"style": means[RESTYLED].style},
    }
    with timed(times, "two control loops, 1 kHz"):
        runs = {name: control(model, means[RUN], command) for name, command in commands.items()}
    figures = {
        "demonstrations": plot.demonstrations(model, demos, labels=labels),
        "singular_values": plot.singular_values(model),
        "styles": plot.styles(model, labels),
        "fan": plot.fan(model, here, there, ends=BLENDED),
        "control": draw_control(model, means[RUN], runs),
    }

    shares = model.singular_values / model.singular_values.sum()
    kept = zip(shares[: model.n_styles + 2], shares.cumsum(), strict=False)
    errors = {
        shape: [
            f"{np.mean([reproduction_error(learnt, demos[m], m) for m in rows]):.1e}"
            for learnt in (model, model_of_all)
        ]
        for shape, rows in members.items()
    }
    text = [
        f"{len(demos)} human demonstrations, J = {model.n_styles}. An error is the RMSE of a "
        "reproduction over the range of the demonstration, averaged over those of the shape.",
        markdown_table(
            ["singular value", "share", "sum"],
            ([k, f"{share:.1%}", f"{total:.1%}"] for k, (share, total) in enumerate(kept, 1)),
        ),
        markdown_table(
            ["shape", f"error, J = {model.n_styles}", f"error, J = {model_of_all.n_styles}"],
            ([shape, *row] for shape, row in errors.items()),
        ),
        markdown_table(
            ["control loop at 1 kHz", "left to the goal", "mean tick", "worst tick"],
            ([name, *run.figures()] for name, run in runs.items()),
        ),
        markdown_table(
            ["part", "time"], ([name, f"{1e3 * time:.1f} ms"] for name, time in times.items())
        ),
    ]
    return Section(f"{len(SHAPES)} handwritten shapes in one primitive", text, figures)


@contextmanager
def timed(times: dict[str, float], name: str) -> Iterator[None]:
    """Records the duration of a step [s]."""
    begin = perf_counter()
    yield
    times[name] = perf_counter() - begin


@dataclass
class Run:
    """Record of a control loop: samples, durations of its ticks [µs], index of the command."""

    position: NDArray[np.float64]
    ticks: NDArray[np.float64]
    switch: int
    goal: NDArray[np.float64]

    def figures(self) -> list[str]:
        """Returns the final distance to the goal, and the mean and worst duration of a tick."""
        left = float(np.linalg.norm(self.goal - self.position[-1]))
        return [f"{left:.1e} mm", f"{self.ticks.mean():.2f} µs", f"{self.ticks.max():.1f} µs"]


def control(model: pdmp.Model, conditions: pdmp.Conditions, command: Mapping[str, Any]) -> Run:
    """Runs a movement at 1 kHz, with a command half way."""
    controller = model.controller(DT, conditions)
    duration = model.durations[model.nominal] * controller.tau / model.tau
    switch = round(0.5 * duration / DT)
    positions = [controller.position.copy()]
    ticks: list[float] = []
    status = pdmp.Status.WORKING
    while status == pdmp.Status.WORKING:
        if len(ticks) == switch:
            for name, value in command.items():
                setattr(controller, name, value)
        begin = perf_counter_ns()
        status = controller.step()
        ticks.append(1e-3 * (perf_counter_ns() - begin))
        positions.append(controller.position.copy())
    return Run(np.array(positions), np.array(ticks), switch, np.array(controller.goal))


def draw_control(model: pdmp.Model, conditions: pdmp.Conditions, runs: Mapping[str, Run]) -> Figure:
    """Draws the movement under each command."""
    columns = movement_panels(model, list(runs), None)
    longest = DT * max(len(run.ticks) for run in runs.values())
    plain = model.rollout(conditions, dt=DT, duration=longest)
    point = {"color": ORANGE, "marker": "o", "linestyle": "", "label": "command"}
    for panels, run in zip(columns, runs.values(), strict=True):
        time = DT * np.arange(len(run.position))
        at = [run.switch]
        draw_movement(
            panels, plain.time, plain.position, color=GREY, linewidth=3, label="left alone"
        )
        draw_movement(panels, time, run.position, color=BLUE, linewidth=1.6, label="commanded")
        draw_movement(panels, time[at], run.position[at], **point)
    legend(columns[0][0])
    return figure_of(columns[0])


if __name__ == "__main__":
    sys.exit(main())
