"""Figures of docs/transport.md."""

from pathlib import Path

import numpy as np

import pdmp
from pdmp.datasets import handwriting
from pdmp.plot.canvas import BLUE, GREY, ORANGE, PALETTE, label_axes, legend, new_figure, save

DT = 0.001  # s
TRANSPORTS = ("learnt", "immediate")
GREEN = PALETTE[2]
ENDS = {"at rest": ("CShape", 1), "in motion": ("Sshape", 0)}  # shape and demonstration
WRITTEN = "NShape"
SHIFT = np.array([10.0, 15.0])  # mm
SERVO = 25.0  # rad/s, natural frequency of the simulated joint
SAG = 0.05  # rad
HELD = (0.8, 1.8)  # s
N_SECONDS = 4.0
TICKS_PER_MEASUREMENT = 10  # a sensor at 100 Hz


def draw(folder: Path) -> None:
    """Draws all figures."""
    moved_goals(folder / "transport.png")
    moved_writing(folder / "control.png")
    two_ends(folder / "end.png")
    perturbed(folder / "perturbation.png")


def moved_goals(path: Path) -> None:
    """Draws reaches to goals nearer, farther and moved on the way, for both transports."""
    figure = new_figure(6.8, 4.2)
    grid = figure.subplots(2, 2, sharex=True, sharey="row", height_ratios=[1.4, 1])
    cases = {
        "demonstrated": (GREY, 0.3, 0.3),
        "nearer goal": (BLUE, 0.15, 0.15),
        "farther goal": (ORANGE, 0.45, 0.45),
        "goal moved at 0.4 s": (GREEN, 0.3, 0.45),
    }
    for (upper, lower), transport in zip(grid.T, TRANSPORTS, strict=True):
        s = np.linspace(0, 1, 101)
        reach = 0.3 * s**3 * (10 - 15 * s + 6 * s**2)
        model = pdmp.fit(
            [(size * reach)[:, None] for size in (0.9, 1.0, 1.1)], dt=0.01, transport=transport
        )
        label_axes(upper, "", "position [m]", f'transport="{transport}"')
        label_axes(lower, "time [s]", "acceleration [m/s²]")
        for label, (color, goal, moved) in cases.items():
            time, position, acceleration = goal_moved(model, goal, moved)
            upper.plot(time, position, color=color, label=label)
            lower.plot(time, acceleration, color=color, label=label)
            upper.plot(1.4, moved, "<", color=color, markersize=5, clip_on=False)
    legend(grid[0, 0])
    save(figure, path)


def goal_moved(model: pdmp.Model, goal: float, moved: float) -> tuple[np.ndarray, ...]:
    """Returns time, position and acceleration of a reach whose goal moves at 0.4 s."""
    controller = model.controller(DT, style=model.styles[1], start=[0.0], goal=[goal])
    motion = [[0.0, controller.position[0], controller.acceleration[0]]]
    for tick in range(1, 1401):
        if tick == 401 and moved != goal:
            controller.goal = [moved]
        controller.step()
        motion.append([tick * DT, controller.position[0], controller.acceleration[0]])
    return tuple(np.transpose(motion))


def moved_writing(path: Path) -> None:
    """Draws a handwritten shape whose goal moves half way, for both transports."""
    figure = new_figure(6.8, 4.6)
    grid = figure.subplots(2, 2, sharex="row", sharey="row", height_ratios=[1.6, 1])
    demos = list(handwriting()[WRITTEN])
    for (upper, lower), transport in zip(grid.T, TRANSPORTS, strict=True):
        model = pdmp.fit(demos, transport=transport)
        conditions = model.conditions(range(model.n_demos))
        duration = np.sum(conditions.segment_durations)
        label_axes(upper, "x [mm]", "", f'transport="{transport}"')
        label_axes(lower, "time [s]", "")
        upper.set_aspect("equal")
        for shift, label, style in (
            (0 * SHIFT, "left alone", {"color": GREY, "linewidth": 3}),
            (SHIFT, "goal moved half way", {"color": BLUE}),
        ):
            controller = model.controller(DT, conditions)
            positions = []
            for tick in range(round(1.5 * duration / DT)):
                if tick == round(0.5 * duration / DT):
                    controller.goal = conditions.goal + shift
                    here = controller.position.copy()
                controller.step()
                positions.append(controller.position.copy())
            x, y = np.transpose(positions)
            upper.plot(x, y, label=label, **style)
            lower.plot(DT * np.arange(1, 1 + len(y)), y, **style)
            upper.plot(*controller.goal, "x", color=style["color"])
        upper.plot(*here, "o", color=ORANGE, label="command")
        lower.axvline(0.5 * duration, color=ORANGE, linewidth=1)
        lower.axvline(duration, color="black", linewidth=0.6)
    grid[0, 0].set_ylabel("y [mm]")
    grid[1, 0].set_ylabel("y [mm]")
    legend(grid[0, 0])
    save(figure, path)


def two_ends(path: Path) -> None:
    """Draws the distance from the goal at the ends of two recordings."""
    figure = new_figure(7, 3)
    grid = figure.subplots(1, 2, sharex=True, sharey=True)
    shapes = handwriting()
    for axes, (title, (shape, m)) in zip(grid, ENDS.items(), strict=True):
        demos = list(shapes[shape])
        extent = max(np.ptp(demo.position, axis=0).max() for demo in demos)
        label_axes(axes, "time / duration", "", f"{shape}: ends {title}")
        for transport, color in zip(TRANSPORTS, (BLUE, ORANGE), strict=True):
            model = pdmp.fit(demos, transport=transport)
            duration = model.durations[m]
            controller = model.controller(duration / 1000, model.conditions(m))
            times, distances, finish = [], [], None
            for tick in range(1, 2001):
                status = controller.step()
                offset = controller.position - model.goals[m]
                times.append(tick / 1000)
                distances.append(100 * np.linalg.norm(offset) / extent)
                if finish is None and status == pdmp.Status.FINISHED:
                    finish = tick - 1
            axes.plot(times, distances, color=color, label=f"{transport} transport")
            if finish is not None:
                label = "FINISHED" if transport == "learnt" else None
                point = {"color": color, "markersize": 5, "zorder": 3, "label": label}
                axes.plot(times[finish], distances[finish], "o", **point)
        demo = demos[m]
        share = (demo.time - demo.time[0]) / np.ptp(demo.time)
        distance = 100 * np.linalg.norm(demo.position - model.goals[m], axis=1) / extent
        axes.plot(share, distance, color=GREY, linewidth=3, zorder=1, label="recording")
        axes.axvline(1, color="black", linewidth=0.6)
    grid[0].set_ylabel("distance from the goal\n[% of the range]")
    grid[0].set_xlim(0.85, 1.8)
    grid[0].set_ylim(-0.15, 9)
    legend(grid[0])
    save(figure, path)


def perturbed(path: Path) -> None:
    """Draws an arm that is held at the elbow and released, and one that sags."""
    figure = new_figure(6.8, 4.1)
    grid = figure.subplots(2, 2, sharex=True, sharey="row", height_ratios=[2, 1])
    s = np.linspace(0, 1, 201)
    reach = 1.2 * s**3 * (10 - 15 * s + 6 * s**2)
    demos = [(size * reach)[:, None] for size in (0.9, 1.0, 1.1)]
    demos = [pdmp.Demonstration(demo, dt=0.01, names=["elbow"], units=["rad"]) for demo in demos]
    model = pdmp.fit(demos)
    for (upper, lower), (title, sag, held) in zip(
        grid.T, (("held and released", 0.0, HELD), ("sagging under a load", SAG, None)), strict=True
    ):
        label_axes(upper, "", "elbow angle [rad]", title)
        label_axes(lower, "time [s]", "phase x")
        motion, finish = simulated(model, sag, held)
        time, commanded, angle, phase, planned = motion
        upper.axhline(model.goals[1, 0], color="black", linewidth=0.6, label="goal")
        upper.plot(time, planned, color=GREY, linewidth=2.5, label="unperturbed")
        upper.plot(time, commanded, color=BLUE, label="commanded")
        upper.plot(time, angle, color=ORANGE, linestyle="--", label="measured")
        lower.semilogy(time, phase, color=BLUE)
        upper.axvline(finish, color=GREEN, linestyle=":", label="FINISHED")
        lower.axvline(finish, color=GREEN, linestyle=":")
        if held:
            for axes in (upper, lower):
                axes.axvspan(*held, color=GREY, alpha=0.3, linewidth=0)
            upper.text(sum(held) / 2, 0.02, "held", ha="center", va="bottom")
    legend(grid[0, 0])
    save(figure, path)


def simulated(
    model: pdmp.Model, sag: float, held: tuple[float, float] | None
) -> tuple[np.ndarray, float]:
    """Simulates a joint that follows a controller and returns its angle to it.

    Returns time, commanded and measured position, phase and the unperturbed movement, as rows of
    one array, and the time of `FINISHED`. The servo is critically damped.
    """
    controller = model.controller(DT, model.conditions(1))
    planned = model.controller(DT, model.conditions(1))
    angle, speed = controller.position[0] - sag, 0.0
    rows, finish = [], np.inf
    for tick in range(round(N_SECONDS / DT)):
        measured = [angle] if tick % TICKS_PER_MEASUREMENT == 0 else None
        status = controller.step(measured=measured)
        planned.step()
        time = (tick + 1) * DT
        if held and held[0] <= time < held[1]:
            speed = 0.0
        else:
            error = controller.position[0] - sag - angle
            speed += DT * (SERVO**2 * error + 2 * SERVO * (controller.velocity[0] - speed))
            angle += DT * speed
        if status == pdmp.Status.FINISHED:
            finish = min(finish, time)
        position = controller.position[0]
        rows.append([time, position, angle, controller.phase, planned.position[0]])
    return np.transpose(rows), finish
