"""Fig. 4: heights of obstacles without a demonstration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import pdmp
from pdmp._markdown import markdown_table
from pdmp.plot._canvas import BLUE, GREY, ORANGE, PALETTE, canvas, dress, legend
from pdmp.preprocessing import resample
from reproduction import paths
from reproduction.loop import PACE, NewGoal, reach_over
from reproduction.reaching import (
    CONSTANTS,
    HEIGHTS,
    TRAINED,
    Reaching,
    demonstrate,
    duration_of,
    height_of,
)
from reproduction.robot import DT, Robot, pile
from reproduction.section import SEED, Section

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

TESTED = tuple(height for height in HEIGHTS if height not in TRAINED)
N_SAMPLES = 201
MOVED = np.array([0.12, 0.0, 0.0])  # m, of the hand: where the goal goes in mid-movement
MOVED_AT = 0.4  # of the demonstrated duration


def learn(reaching: Reaching, n_styles: int) -> pdmp.Model:
    """Learns from the reaches over none, two and three boxes, and U: h ↦ β[h, 1]."""
    return pdmp.fit(reaching.of(TRAINED), n_styles=n_styles, map="linear", **CONSTANTS)


def error(model: pdmp.Model, reaching: Reaching, demo: pdmp.Demonstration, style: Array) -> float:
    """Returns E = (1/T) Σ ‖ŷ − y‖² [rad²] of a movement in this style, in aligned time."""
    gap = movement(model, reaching, style) - aligned(demo)
    return float(np.mean(np.sum(gap**2, axis=1)))


def movement(model: pdmp.Model, reaching: Reaching, style: Array) -> Array:
    """Returns the movement in this style at `N_SAMPLES` shares of its duration (N_SAMPLES, D)."""
    duration = float(model.durations[model.nominal])
    made = model.rollout(
        style=style,
        goal=reaching.goal,
        start=reaching.start,
        dt=duration / (N_SAMPLES - 1),
        duration=duration,
    )
    return made.position


def predicted_style(model: pdmp.Model, height: float) -> Array:
    """Returns the style (J,) that U predicts for a height [m]."""
    return np.asarray(model.predict([height]).conditions.style)


def best_style(model: pdmp.Model, reaching: Reaching, demo: pdmp.Demonstration) -> Array:
    """Returns the style of least E for a demonstration: movements are linear in it."""
    plain = movement(model, reaching, np.zeros(model.n_styles))
    duration = float(model.durations[model.nominal])
    added = model.jacobian("style", dt=duration / (N_SAMPLES - 1), duration=duration)
    columns = added.reshape(-1, model.n_styles)
    return np.asarray(np.linalg.lstsq(columns, (aligned(demo) - plain).ravel())[0], dtype=float)


def aligned(demo: pdmp.Demonstration) -> Array:
    """Returns a demonstration at `N_SAMPLES` shares of its duration (N_SAMPLES, D)."""
    return resample(demo, duration_of(demo) / (N_SAMPLES - 1)).position


@dataclass(frozen=True)
class Errors:
    """E of the test demonstrations by J, (J, 6) each [rad²]."""

    predicted: Array
    """In the style that U predicts from the height."""
    best: Array
    """In the style that makes it least: what J styles can express."""


def errors(reaching: Reaching, most: int = 9) -> Errors:
    """Returns the errors of one to `most` styles on the heights that were not trained."""
    tests = reaching.of(TESTED)
    predicted, best = [], []
    for n_styles in range(1, most + 1):
        model = learn(reaching, n_styles)
        styles = [predicted_style(model, height_of(demo)) for demo in tests]
        predicted.append(
            [error(model, reaching, *pair) for pair in zip(tests, styles, strict=True)]
        )
        styles = [best_style(model, reaching, demo) for demo in tests]
        best.append([error(model, reaching, *pair) for pair in zip(tests, styles, strict=True)])
    return Errors(np.array(predicted), np.array(best))


def reach_predicted(
    model: pdmp.Model, reaching: Reaching, height: float, *events: NewGoal
) -> Robot:
    """Reaches over a height [m] in the style predicted for it."""
    style = predicted_style(model, height)
    return reach_over(model, reaching, height, style, *events)


def new_goal(model: pdmp.Model, reaching: Reaching) -> NewGoal:
    """Returns a goal 12 cm farther from the body, given in mid-movement."""
    usual = np.array([reaching.arm.swivel(reaching.goal)])
    place = (reaching.task.goal + MOVED)[None]
    goal = reaching.arm.reach(place, usual, reaching.goal)[0]
    return NewGoal(MOVED_AT * lasting(model), goal)


def lasting(model: pdmp.Model) -> float:
    """Returns the duration of the nominal demonstration at the robot's pace [s]."""
    return float(model.durations[model.nominal] * PACE / model.tau)


def figure_4(seed: int = SEED) -> Section:
    """Reproduces Fig. 4."""
    reaching = demonstrate(seed)
    found = errors(reaching)
    models = {n_styles: learn(reaching, n_styles) for n_styles in range(1, 5)}
    tried = {
        n_styles: {height: reach_predicted(model, reaching, height) for height in TESTED}
        for n_styles, model in models.items()
    }
    command = new_goal(models[3], reaching)
    robots = tried[3]
    moved = {height: reach_predicted(models[3], reaching, height, command) for height in TESTED}
    by_styles = [
        [
            n_styles,
            *(f"{robot.log.contact():.3f} s" for robot in reached.values()),
            *(f"{1e3 * robot.log.tracking_error():.0f} mrad" for robot in reached.values()),
        ]
        for n_styles, reached in tried.items()
    ]
    text = [
        "Learnt from nine reaches over none, two and three boxes; six over one box and over four "
        "are predicted by U(h) = β[h, 1]. E in 10⁻³ rad², mean ± standard deviation over the six; "
        "at best is in the style for which E is least.",
        markdown_table(
            ["J", "E predicted", "E at best"],
            (
                [n + 1, *(f"{1e3 * row.mean():.1f} ± {1e3 * row.std():.1f}" for row in rows)]
                for n, rows in enumerate(zip(found.predicted, found.best, strict=True))
            ),
        ),
        "Time for which the predicted movement touches a box, on the robot, and how far a joint is "
        "off its command at most, which is far where the command is beyond the joint's limit:",
        markdown_table(
            [
                "J",
                *(f"touches {pile(height)}" for height in TESTED),
                *(f"off, over {pile(height)}" for height in TESTED),
            ],
            by_styles,
        ),
        "With J = 3, what is left to the goal, as printed or moved in mid-movement:",
        markdown_table(
            ["", "as printed", "moved"],
            (
                [
                    pile(height),
                    f"{reaching.miss(robots[height].log.hands[-1]):.2f} mm",
                    f"{reaching.miss(moved[height].log.hands[-1], command.goal):.2f} mm",
                ]
                for height in TESTED
            ),
        ),
    ]
    return Section(
        "Fig. 4: heights without a demonstration",
        text,
        {
            "fig4_errors": draw_errors(found),
            "fig4_paths": draw_paths(reaching, robots, moved, command),
        },
    )


def draw_errors(found: Errors) -> Figure:
    """Draws E over J."""
    figure = canvas(None, 5.2, 3.8)
    axes = figure.subplots()
    n_styles = np.arange(1, len(found.predicted) + 1)
    for rows, color, label in (
        (found.predicted, BLUE, "predicted from the height"),
        (found.best, ORANGE, "at best"),
    ):
        mean, spread = rows.mean(axis=1), rows.std(axis=1)
        axes.errorbar(n_styles, mean, spread, color=color, marker="o", capsize=3, label=label)
    dress(axes, "number of styles J", "E [rad²]", "prediction error on new heights")
    axes.set_ylim(bottom=0)
    legend(figure, axes)
    return figure


def draw_paths(
    reaching: Reaching, robots: dict[float, Robot], moved: dict[float, Robot], command: NewGoal
) -> Figure:
    """Draws the predicted and the demonstrated path of the hand from the side."""
    figure = canvas(None, 9.5, 4.6)
    panels = figure.subplots(1, len(robots), sharey=True)
    for axes, height in zip(panels, robots, strict=True):
        paths.draw_boxes(axes, reaching, height)
        for demo in reaching.of((height,)):
            hands = reaching.arm.hands(demo.position)
            paths.draw_hand(axes, reaching, hands, color=GREY, linestyle=":", label="demonstrated")
        predicted, turned = (np.array(robot[height].log.hands) for robot in (robots, moved))
        paths.draw_hand(axes, reaching, predicted, color=BLUE, label="predicted, J = 3")
        after = turned[round(command.time / DT) :]
        look: dict[str, Any] = {"color": PALETTE[2], "marker": "^", "markevery": 250}
        paths.draw_hand(axes, reaching, after, **look, label="goal moved")
        way, up = reaching.side_view(reaching.arm.hands([command.goal]))
        axes.plot(way, up, "*", color=PALETTE[2], markersize=12, label="new goal")
        paths.dress_side(axes, pile(height))
    panels[0].set_ylim(bottom=0)
    legend(figure, panels[0])
    return figure
