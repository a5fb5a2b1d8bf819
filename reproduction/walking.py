"""Fig. 5: arm swing with switches of style, amplitude and frequency."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import pdmp
from pdmp._markdown import markdown_table
from pdmp.io import read_csv
from pdmp.plot.canvas import BLUE, ORANGE, label_axes, new_figure
from pdmp.preprocessing import cycles
from reproduction import film
from reproduction.robot import Robot
from reproduction.section import SEED, Section
from reproduction.swing import NAMES, STYLES, demonstrate
from reproduction.torques import DT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

CONSTANTS: dict[str, Any] = {
    **{"alpha_z": 0.5, "beta_z": 0.5, "mu": 0.1},
    **{"singular_value_share": 0.9, "smoothing": None},
}
"""The printed line lacks a comma, or means β_z = 1; it is read as α_z = 0.5, β_z = 0.5."""
SWITCH_INTERVAL = 20.0  # s between switches
SETTLING_PERIODS = 5  # periods until convergence to a new cycle
RECORDED = [f"{side}_{angle}" for side in "rl" for angle in ("sh1", "sh2", "sh3", "elb")]
MAX_STRIDE_RATE = 1.95  # strides per second, the maximum of people who run freely (see `swing`)


@dataclass(frozen=True)
class Switch:
    """Command and its name."""

    name: str
    command: dict[str, Any]


@dataclass
class SwingResult:
    """Commanded movement of the arms and its switches."""

    position: list[Array] = field(default_factory=list)
    """Joint angles [rad], with a row per tick."""
    distances: list[float] = field(default_factory=list)
    """Distance from the new cycle, over its range, in the sixth period after each switch.

    NaN if the next switch is earlier.
    """


def learn(demos: Sequence[pdmp.Demonstration]) -> pdmp.Model:
    """Fits a model with the printed constants; J follows from the singular values."""
    return pdmp.fit(demos, kind="rhythmic", **CONSTANTS)


def switches(model: pdmp.Model, styles: Sequence[int], names: Sequence[str]) -> list[Switch]:
    """Returns an initial style, then switches of style, amplitude, frequency, and style again.

    A style is switched with its anchor. The frequency is that of the first style until switched.
    """
    first, second, third = (_style(model, m) for m in styles)
    tau = model.tau * float(model.durations[styles[0]] / model.durations[model.nominal])
    return [
        Switch(names[styles[0]], {**first, "tau": tau}),
        Switch(f"style: {names[styles[1]]}", second),
        Switch("amplitude × 0.6", {"amplitude": 0.6}),
        Switch("frequency × 1.2", {"tau": tau / 1.2}),
        Switch(f"style: {names[styles[2]]}", {**third, "amplitude": 1.0, "tau": tau}),
    ]


def swing(
    model: pdmp.Model,
    switches: Sequence[Switch],
    robot: Robot | None = None,
    interval: float = SWITCH_INTERVAL,
) -> SwingResult:
    """Swings the arms, with a command every `interval` seconds; a robot, if given, follows."""
    controller = model.controller(dt=DT, **switches[0].command)
    result = SwingResult()
    for switch in switches:
        for name, value in switch.command.items():
            setattr(controller, name, value)
        cycle = _Cycle(model, controller)
        since, worst = 0.0, np.nan
        for _ in range(round(interval / DT)):
            controller.step()
            if robot is not None:
                robot.move(controller.position, controller.velocity, controller.acceleration)
            result.position.append(controller.position.copy())
            since += DT / cycle.period
            if SETTLING_PERIODS <= since < SETTLING_PERIODS + 1:
                worst = float(np.fmax(worst, cycle.distance(controller)))
        result.distances.append(worst)
    return result


class _Cycle:
    """Limit cycle of a controller's commands."""

    def __init__(self, model: pdmp.Model, controller: pdmp.Controller) -> None:
        self.period = 2 * np.pi * float(controller.tau)
        n_steps = 2000
        rollout = model.rollout(
            style=controller.style,
            anchor=controller.anchor,
            amplitude=controller.amplitude,
            tau=controller.tau,
            dt=self.period / n_steps,
        )
        self._phases = 2 * np.pi * np.arange(n_steps + 1) / n_steps
        self._position = rollout.position[: n_steps + 1]
        self._range = np.ptp(self._position, axis=0).max()

    def distance(self, controller: pdmp.Controller) -> float:
        """Returns the distance from the cycle at the phase of a controller, over its range."""
        here = [np.interp(controller.phase, self._phases, joint) for joint in self._position.T]
        return float(np.abs(controller.position - here).max() / self._range)


def figure_5(recordings: str | PathLike[str] | None = None, seed: int = SEED) -> Section:
    """Reproduces Fig. 5 with generated cycles on the robot, and with recordings if given."""
    walks = None if recordings is None else recorded(Path(recordings))
    names = list(STYLES)
    model = learn(demonstrate(seed))
    chosen = [names.index(name) for name in ("normal", "marching", "girly")]
    commands = switches(model, chosen, names)
    robot = Robot(model.rollout(**commands[0].command).position[0])
    result = swing(model, commands, robot)
    text = [
        f"{len(names)} styles of both arms, {model.n_dofs} joints. {_singular_values(model)} "
        f"The largest tracking error on the robot is {1e3 * robot.log.tracking_error():.1f} mrad.",
        _settling(commands, result),
    ]
    section = Section(
        "Fig. 5: stylised arm swing",
        text,
        {"fig5_joints": draw(model, commands, result, NAMES[:4])},
    )
    film.attach(section, "fig5_robot", _instants(model, robot, chosen, names), film.SWINGING)
    if walks is not None:
        paragraphs, section.figures["fig5_recorded"] = walks
        section.text += paragraphs
    return section


def draw(
    model: pdmp.Model, commands: Sequence[Switch], result: SwingResult, names: Sequence[str]
) -> Figure:
    """Draws the joints of one arm about each switch."""
    position = np.array(result.position)
    interval = len(position) * DT / len(commands)
    figure = new_figure(11.0, 7.0)
    panels = figure.subplots(len(names), len(commands) - 1, sharey="row", sharex="col")
    for column, switch in enumerate(commands[1:], start=1):
        at = column * interval
        rows = slice(round((at - 4) / DT), round((at + 8) / DT))
        time = DT * np.arange(rows.start, rows.stop)
        for joint, name in enumerate(names):
            axes = panels[joint, column - 1]
            axes.axvline(at, color=ORANGE, linewidth=1)
            axes.plot(time, position[rows, joint], color=BLUE, linewidth=1.1)
            label_axes(axes, "", f"{name} [rad]" if column == 1 else "")
        panels[0, column - 1].set_title(switch.name, fontsize=9)
        panels[-1, column - 1].set_xlabel("time [s]")
    return figure


def _style(model: pdmp.Model, m: int) -> dict[str, Any]:
    conditions = model.conditions(m)
    return {"style": conditions.style, "anchor": conditions.anchor}


def _instants(
    model: pdmp.Model, robot: Robot, chosen: Sequence[int], names: Sequence[str]
) -> dict[str, tuple[Robot, list[float]]]:
    """Returns six times in a stride, late in the first, second and last interval."""
    normal, marching, girly = (names[m] for m in chosen)
    stride = np.arange(6) / 6 * model.durations[chosen[0]]
    spells = {normal: 1, marching: 2, girly: 5}
    return {name: (robot, list(n * SWITCH_INTERVAL - 4 + stride)) for name, n in spells.items()}


def recorded(folder: Path) -> tuple[list[str], Figure]:
    """Fits recordings of walking people, one mean stride each."""
    files = sorted(folder.glob("*.csv"))
    if not files:
        raise ValueError(f"recordings: {folder} has no CSV file, each of one walking person")
    demos, names, aperiodic = [], [], []
    for file in files:
        recording = read_csv(file, columns=RECORDED)
        try:
            period = float(cycles(recording, average=True).periods[0])
        except ValueError:
            aperiodic.append(file.stem)
            continue
        if period * MAX_STRIDE_RATE < 1:
            aperiodic.append(file.stem)
            continue
        demos.append(recording)
        names.append(file.stem)
    if len(demos) < 4:
        raise ValueError(
            f"recordings: {folder} has {len(demos)} periodic recordings: pass at least 4"
        )
    strides = cycles(demos, average=True)
    model = learn(list(strides))
    by_range = np.argsort([np.ptp(stride.position, axis=0).max() for stride in strides])
    # Recordings of median, larger and largest range: no style is switched to itself.
    chosen = [int(by_range[share * (len(demos) - 1) // 4]) for share in (2, 3, 4)]
    commands = switches(model, chosen, names)
    result = swing(model, commands)
    without = f", without {', '.join(aperiodic)}, which are not periodic" if aperiodic else ""
    paragraphs = [
        f"Recordings of {len(demos)} walks{without}. {_singular_values(model)}",
        _settling(commands, result),
    ]
    return paragraphs, draw(model, commands, result, RECORDED[:4])


def _singular_values(model: pdmp.Model) -> str:
    """Returns a sentence on the number of styles and the share of four, the number in the paper."""
    share = model.singular_values[:4].sum() / model.singular_values.sum()
    return (
        f"J = {model.n_styles} is the smallest number above 90 % of the sum of singular values; "
        f"four have {share:.1%}."
    )


def _settling(commands: Sequence[Switch], result: SwingResult) -> str:
    rows = zip(commands, result.distances, strict=True)
    header = ["switch", "distance from the new cycle in the sixth period"]
    return markdown_table(
        header, ([switch.name, f"{distance:.2%} of its range"] for switch, distance in rows)
    )
