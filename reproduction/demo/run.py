"""Fit of the shapes, and a report."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from time import perf_counter

import numpy as np

import pdmp
from pdmp import plot
from pdmp._files import atomic_write
from pdmp.datasets import handwriting
from reproduction.demo.loop import DT, control, draw_control
from reproduction.demo.report import error_table, loop_table, singular_value_table, time_table

SHAPES = ("CShape", "GShape", "NShape", "Sshape", "WShape")
BLENDED = ("CShape", "Sshape")
RUN, RESTYLED = "NShape", "WShape"
GOAL_SHIFT = np.array([10.0, 15.0])  # mm


def run_demo(
    folder: str | PathLike[str], progress: Callable[[str, float], object] | None = None
) -> str:
    """Fits one primitive to five handwritten shapes; writes model, figures and a report.

    Parameters
    ----------
    folder : path
        Folder for `model.safetensors`, `report.md` and the figures.
    progress : callable, optional
        Called with the stage of the fit and its completed fraction.

    Returns
    -------
    str
        The tables of the report, in Markdown.

    Raises
    ------
    ImportError
        The dependency group `demo` is not installed.
    OSError
        A file that cannot be written.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
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
    with timed(times, "draw"):
        figures = {
            "demonstrations": plot.demonstrations(model, demos, labels=labels),
            "singular_values": plot.singular_values(model),
            "styles": plot.styles(model, labels),
            "fan": plot.fan(model, here, there, ends=BLENDED),
            "control": draw_control(model, means[RUN], runs),
        }
        for name, figure in figures.items():
            plot.save(figure, folder / f"{name}.png")

    report = "\n\n".join(
        [
            f"# {len(SHAPES)} handwritten shapes in one primitive",
            f"{len(demos)} human demonstrations, J = {model.n_styles}. An error is the RMSE of a "
            "reproduction over the range of the demonstration, averaged over those of the shape.",
            singular_value_table(model),
            error_table([model, model_of_all], demos, members),
            loop_table(runs),
            time_table(times),
        ]
    )
    images = "\n\n".join(f"![{name}]({name}.png)" for name in figures)
    with atomic_write(folder / "report.md") as draft:
        draft.write_text(f"{report}\n\n{images}\n", encoding="utf-8")
    return report


@contextmanager
def timed(times: dict[str, float], name: str) -> Iterator[None]:
    """Records the duration of a step [s]."""
    begin = perf_counter()
    yield
    times[name] = perf_counter() - begin
