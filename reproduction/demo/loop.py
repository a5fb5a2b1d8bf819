"""Control loop at 1 kHz with a command half way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter_ns
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import pdmp
from pdmp.plot.canvas import BLUE, GREY, ORANGE, draw_movement, legend, movement_panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DT = 0.001  # s


@dataclass
class Run:
    """Record of a control loop: samples, durations of its ticks [µs], index of the command."""

    position: NDArray[np.float64]
    ticks: NDArray[np.float64]
    switch: int
    goal: NDArray[np.float64]

    @property
    def left(self) -> float:
        """Distance between the goal and the last position [mm]."""
        return float(np.linalg.norm(self.goal - self.position[-1]))


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
    figure, columns = movement_panels(model, list(runs), None)
    longest = DT * max(len(run.ticks) for run in runs.values())
    plain = model.rollout(conditions, dt=DT, duration=longest)
    for panels, run in zip(columns, runs.values(), strict=True):
        time = DT * np.arange(len(run.position))
        at = slice(run.switch, run.switch + 1)
        draw_movement(
            panels, plain.time, plain.position, color=GREY, linewidth=3, label="left alone"
        )
        draw_movement(panels, time, run.position, color=BLUE, linewidth=1.6, label="commanded")
        draw_movement(
            panels,
            time[at],
            run.position[at],
            color=ORANGE,
            marker="o",
            linestyle="",
            label="command",
        )
    legend(figure, columns[0][0])
    return figure
