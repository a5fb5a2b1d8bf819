"""Fig. 4: obstacles of heights that were not demonstrated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import pdmp
from pdmp._markdown import markdown_table
from pdmp.plot.canvas import BLUE, GREY, ORANGE, PALETTE, label_axes, legend, new_figure
from pdmp.preprocessing import resample
from reproduction import bounded, paths
from reproduction.loop import TAU, NewGoal, reach_over
from reproduction.reaching import (
    CONSTANTS,
    HEIGHTS,
    TRAINING_HEIGHTS,
    Reaching,
    demonstrate,
    duration_of,
    height_of,
)
from reproduction.robot import Robot, pile
from reproduction.section import SEED, Section
from reproduction.torques import DT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

TESTED = tuple(height for height in HEIGHTS if height not in TRAINING_HEIGHTS)
N_SAMPLES = 201
GOAL_OFFSET = np.array([0.12, 0.0, 0.0])  # m, change of the goal of the hand during the movement
GOAL_CHANGE_AT = 0.4  # of the demonstrated duration


def learn(reaching: Reaching, n_styles: int) -> pdmp.Model:
    """Fits the reaches over zero, two and three boxes, with U: h ↦ β[h, 1]."""
    return pdmp.fit(reaching.of(TRAINING_HEIGHTS), n_styles=n_styles, map="linear", **CONSTANTS)


def error(model: pdmp.Model, reaching: Reaching, demo: pdmp.Demonstration, style: Array) -> float:
    """Returns E = (1/T) Σ ‖ŷ − y‖² [rad²] of the movement of a style, in aligned time."""
    difference = movement(model, reaching, style) - aligned(demo)
    return float(np.mean(np.sum(difference**2, axis=1)))


def movement(model: pdmp.Model, reaching: Reaching, style: Array) -> Array:
    """Returns the movement of a style (N_SAMPLES, D) over normalised time."""
    duration = float(model.durations[model.nominal])
    rollout = model.rollout(
        style=style,
        goal=reaching.goal,
        start=reaching.start,
        dt=duration / (N_SAMPLES - 1),
        duration=duration,
    )
    return rollout.position


def predicted_style(model: pdmp.Model, height: float) -> Array:
    """Returns the style (J,) that U predicts for a height [m]."""
    return np.asarray(model.predict([height]).conditions.style)


def best_style(model: pdmp.Model, reaching: Reaching, demo: pdmp.Demonstration) -> Array:
    """Returns the style that minimises E of a demonstration; movements are linear in it."""
    plain = movement(model, reaching, np.zeros(model.n_styles))
    duration = float(model.durations[model.nominal])
    added = model.jacobian("style", dt=duration / (N_SAMPLES - 1), duration=duration)
    columns = added.reshape(-1, model.n_styles)
    return np.asarray(np.linalg.lstsq(columns, (aligned(demo) - plain).ravel())[0], dtype=float)


def aligned(demo: pdmp.Demonstration) -> Array:
    """Returns a demonstration (N_SAMPLES, D) over normalised time."""
    return resample(demo, duration_of(demo) / (N_SAMPLES - 1)).position


@dataclass(frozen=True)
class Errors:
    """E of the test demonstrations by J [rad²], (J, 6)."""

    predicted: Array
    """E of the style that U predicts from the height."""
    best: Array
    """E of the best of all styles, the limit of J style parameters."""


def errors(reaching: Reaching, max_styles: int = 9) -> Errors:
    """Returns the errors of 1 to `max_styles` style parameters at the test heights."""
    tests = reaching.of(TESTED)
    predicted, best = [], []
    for n_styles in range(1, max_styles + 1):
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
    """Drives the robot over an obstacle of this height [m] with the predicted style."""
    style = predicted_style(model, height)
    return reach_over(model, reaching, height, style, *events)


def new_goal(model: pdmp.Model, reaching: Reaching) -> NewGoal:
    """Returns a command during the movement: a goal 12 cm farther from the body."""
    usual = np.array([reaching.arm.swivel(reaching.goal)])
    goal_hand = (reaching.task.goal + GOAL_OFFSET)[None]
    goal = reaching.arm.reach(goal_hand, usual, reaching.goal)[0]
    return NewGoal(GOAL_CHANGE_AT * robot_duration(model), goal)


def robot_duration(model: pdmp.Model) -> float:
    """Returns the duration of the nominal demonstration with the robot's time constant [s]."""
    return float(model.durations[model.nominal] * TAU / model.tau)


def figure_4(seed: int = SEED) -> Section:
    """Reproduces Fig. 4."""
    reaching = demonstrate(seed)
    test_errors = errors(reaching)
    models = {n_styles: learn(reaching, n_styles) for n_styles in range(1, 5)}
    styles = {
        n_styles: {height: predicted_style(model, height) for height in TESTED}
        for n_styles, model in models.items()
    }
    robots_by_styles = {
        n_styles: {
            height: reach_over(model, reaching, height, style)
            for height, style in styles[n_styles].items()
        }
        for n_styles, model in models.items()
    }
    command = new_goal(models[3], reaching)
    robots = robots_by_styles[3]
    moved = {height: reach_predicted(models[3], reaching, height, command) for height in TESTED}
    by_styles = [
        [
            n_styles,
            *(f"{robot.log.contact():.3f} s" for robot in reached.values()),
            *(f"{1e3 * robot.log.tracking_error():.0f} mrad" for robot in reached.values()),
        ]
        for n_styles, reached in robots_by_styles.items()
    ]
    text = [
        "Fitted to nine reaches over zero, two and three boxes; six over one and four boxes "
        "are predicted by U(h) = β[h, 1]. E in 10⁻³ rad², mean ± standard deviation over the six; "
        "the best style minimises E.",
        markdown_table(
            ["J", "E predicted", "E of the best style"],
            (
                [n + 1, *(f"{1e3 * row.mean():.1f} ± {1e3 * row.std():.1f}" for row in rows)]
                for n, rows in enumerate(zip(test_errors.predicted, test_errors.best, strict=True))
            ),
        ),
        "Duration of contact of the predicted movement with a box, on the robot, and largest "
        "tracking error, which is large where the command exceeds a joint limit:",
        markdown_table(
            [
                "J",
                *(f"contact, {pile(height)}" for height in TESTED),
                *(f"tracking error, {pile(height)}" for height in TESTED),
            ],
            by_styles,
        ),
        *bounded.table(models, styles, robots_by_styles, reaching),
        "Final distance to the goal with J = 3, as printed or moved during the movement:",
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
        "Fig. 4: heights that were not demonstrated",
        text,
        {
            "fig4_errors": draw_errors(test_errors),
            "fig4_paths": draw_paths(reaching, robots, moved, command),
        },
    )


def draw_errors(errors: Errors) -> Figure:
    """Draws E over J."""
    figure = new_figure(5.2, 3.8)
    axes = figure.subplots()
    n_styles = np.arange(1, len(errors.predicted) + 1)
    for rows, color, label in (
        (errors.predicted, BLUE, "predicted from the height"),
        (errors.best, ORANGE, "best style"),
    ):
        mean, spread = rows.mean(axis=1), rows.std(axis=1)
        axes.errorbar(n_styles, mean, spread, color=color, marker="o", capsize=3, label=label)
    label_axes(axes, "number of styles J", "E [rad²]", "prediction error on new heights")
    axes.set_ylim(bottom=0)
    legend(axes)
    return figure


def draw_paths(
    reaching: Reaching, robots: dict[float, Robot], moved: dict[float, Robot], command: NewGoal
) -> Figure:
    """Draws the predicted and the demonstrated path of the hand from the side."""
    figure = new_figure(9.5, 4.6)
    panels = figure.subplots(1, len(robots), sharey=True)
    for axes, height in zip(panels, robots, strict=True):
        paths.draw_boxes(axes, reaching, height)
        for demo in reaching.of((height,)):
            hands = reaching.arm.hands(demo.position)
            paths.draw_hand(axes, reaching, hands, color=GREY, linestyle=":", label="demonstrated")
        predicted, turned = (np.array(robot[height].log.hands) for robot in (robots, moved))
        paths.draw_hand(axes, reaching, predicted, color=BLUE, label="predicted, J = 3")
        after = turned[round(command.time / DT) :]
        style_kwargs: dict[str, Any] = {"color": PALETTE[2], "marker": "^", "markevery": 250}
        paths.draw_hand(axes, reaching, after, **style_kwargs, label="goal moved")
        distance, hand_height = reaching.side_view(reaching.arm.hands([command.goal]))
        axes.plot(distance, hand_height, "*", color=PALETTE[2], markersize=12, label="new goal")
        paths.label_side_view(axes, pile(height))
    panels[0].set_ylim(bottom=0)
    legend(panels[0])
    return figure
