"""Figures of the runs, and text of docs/poses_in_simulation.md."""

import numpy as np

from pdmp._markdown import markdown_table
from poses import box, panda
from recordings import sources

INTRODUCTION = """\
# Poses on simulated robots

`make bench-poses` measures this; `PYTHONPATH=benches .venv/bin/python -m poses --write` updates
this file and its pictures. Both robots are simulated in MuJoCo with models of robosuite 1.5.2 (MIT
licence), and driven at 1 kHz: the pose of a controller goes to differential inverse kinematics by
mink, with limits of position and velocity of the joints, and from there to computed torque control.
`pdmp.robots.MujocoKinematics` gives the measured poses. With `measured=`, they go back to the
controller.

## A tool path on a Panda

![Frames of the Panda; path of the tool commanded in blue, measured in orange](poses_panda.png)

The primitive is fitted to the recorded tool poses of a task, and moves as the third of them. The
tasks `openbox` and `pouring` were recorded on a Franka, nine poses each, with a phase instead of
the time; they take {duration:g} s here. `sink` was recorded on a KUKA, eleven paths without
orientations, on which the hand points downwards; it is {slower:g} times slower here. In the last
two columns, a person holds the elbow from {held[0]:g} to {held[1]:g} s, modelled by a stiff spring.
Without `measured=`, the commanded pose moves on meanwhile, and the released tool rushes after it.
"""
BOX = """\
## A box between the hands of Baxter

![Frames of Baxter, which carries a box](poses_box.png)

The demonstrations are twelve synthetic movements of both hands with a box, in which each hand has
an error of some millimetres: their relative poses deviate by up to {apart:.0f} mm and {angle:.1f}°
from their mean. The mean (`pdmp.robots.mean_pose`), {squeeze:.0f} mm closer than the box is wide,
replaces them, and the primitive is fitted to absolute and relative pose. The pads of the hands hold
a box of {mass:g} kg by friction alone. With `measured=`, the controller receives the measured
absolute pose and the commanded relative one, and gives way in the absolute pose alone. In the last
two columns, a person holds the right shoulder from {held[0]:g} to {held[1]:g} s: the movement waits
with `measured=`; without it, the hands are pulled apart.
"""
CONDITIONS = ["", "measured", "held", "held, measured"]


def largest(poses: np.ndarray, others: np.ndarray) -> str:
    """Returns the largest distance and angle between poses, in mm and degrees."""
    apart, angle = box.deviation(poses, others)
    return f"{1e3 * apart.max():.2f}, {np.degrees(angle.max()):.2f}"


def median(poses: np.ndarray, others: np.ndarray) -> str:
    """Returns the median distance and angle between poses, in mm and degrees."""
    apart, angle = box.deviation(poses, others)
    return f"{1e3 * np.median(apart):.2f}, {np.degrees(np.median(angle)):.2f}"


def of_panda(records: list[panda.Record]) -> str:
    """Returns the figures of runs of the Panda, a column for each."""
    rows: list[list[str]] = [
        ["duration [s]"],
        ["tracking error, median [mm, °]"],
        ["tracking error, largest [mm, °]"],
        ["speed of the tool, largest [m/s]"],
        ["ticks with a motor at its limit"],
    ]
    for record in records:
        commanded, measured = record.rows("commanded"), record.rows("measured")
        speed = np.linalg.norm(np.diff(measured[:, :3], axis=0), axis=1) / panda.DT
        figures = [
            f"{len(commanded) * panda.DT:.2f}",
            median(measured, commanded),
            largest(measured, commanded),
            f"{speed.max():.2f}",
            f"{record.rows('saturated').mean():.1%}",
        ]
        for row, figure in zip(rows, figures, strict=True):
            row.append(figure)
    return markdown_table(["", *(name or "open loop" for name in CONDITIONS)], rows)


def of_box(records: list[box.Record]) -> str:
    """Returns the figures of runs of Baxter, a column for each."""
    rows: list[list[str]] = [
        ["duration [s]"],
        ["commanded grasp, largest change [m, rad]"],
        ["measured grasp, largest change [mm, °]"],
        ["absolute pose, median error [mm, °]"],
        ["absolute pose, largest error [mm, °]"],
        ["box in the hands, largest slip [mm, °]"],
        ["ticks with both pads on the box"],
        ["smallest force of a pad [N]"],
        ["ticks with other contacts"],
        ["ticks with a motor at its limit"],
    ]
    for record in records:
        commanded, measured = record.rows("commanded"), record.rows("measured")
        apart, angle = box.deviation(commanded[:, 7:], commanded[0, 7:])
        force = record.rows("force")
        offset, turn = box.in_frame(record.rows("box"), measured[:, :7])
        figures = [
            f"{len(commanded) * box.DT:.2f}",
            f"{apart.max():.0e}, {angle.max():.0e}",
            largest(measured[:, 7:], measured[0, 7:]),
            median(measured[:, :7], commanded[:, :7]),
            largest(measured[:, :7], commanded[:, :7]),
            f"{1e3 * offset.max():.2f}, {np.degrees(turn.max()):.2f}",
            f"{(force > 0).all(axis=1).mean():.1%}",
            f"{force.min():.0f}",
            f"{record.rows('others').mean():.1%}",
            f"{record.rows('saturated').mean():.1%}",
        ]
        for row, figure in zip(rows, figures, strict=True):
            row.append(figure)
    return markdown_table(["", *(name or "open loop" for name in CONDITIONS)], rows)


def text(
    pandas: dict[str, list[panda.Record]], boxes: list[box.Record], spread: tuple[float, float]
) -> str:
    """Returns the report.

    Parameters
    ----------
    pandas : dict of str to list of panda.Record
        Runs of each task, in the order of `CONDITIONS`; empty without recordings.
    boxes : list of box.Record
        Runs of Baxter, in the same order.
    spread : tuple of float
        Largest deviation of the demonstrated relative poses from their mean [m, rad].
    """
    parts = [INTRODUCTION.format(duration=panda.DURATION, slower=panda.SLOWER, held=panda.HELD)]
    for task, records in pandas.items():
        parts += [f"Task `{task}`:\n", of_panda(records), ""]
    parts += [
        BOX.format(
            apart=1e3 * spread[0],
            angle=np.degrees(spread[1]),
            squeeze=1e3 * box.SQUEEZE,
            mass=box.MASS,
            held=box.HELD,
        ),
        of_box(boxes),
        "",
        sources(panda.SOURCES if pandas else []),
        "",
    ]
    return "\n".join(parts)
