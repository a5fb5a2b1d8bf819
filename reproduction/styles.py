"""Fig. 3: reaching over boxes in several styles, to several goals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

import pdmp
from pdmp._markdown import markdown_table
from pdmp.plot.canvas import GREY, PALETTE, new_figure
from reproduction import film, paths
from reproduction.loop import reach_over
from reproduction.reaching import CONSTANTS, HEIGHTS, Reaching, demonstrate, height_of
from reproduction.robot import Robot, pile
from reproduction.section import SEED, Section

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

N_STYLES = 3
DRAWN_TRIALS = (1, 7, 13)  # the second trials over zero, two and four boxes
FRAMES = (0.0, 0.7, 1.2, 1.7, 2.3, 4.0)  # s
GOAL_OFFSETS = np.array(
    [[0.12, 0.0, 0.0], [0.05, 0.05, 0.12]]
)  # m, goals of the hand relative to the printed goal


def learn(reaching: Reaching, n_styles: int = N_STYLES) -> pdmp.Model:
    """Fits all fifteen reaches with the printed constants."""
    return pdmp.fit(reaching.demos, n_styles=n_styles, **CONSTANTS)


def goals(reaching: Reaching) -> list[Array]:
    """Returns the printed goal and two others [rad]."""
    usual = reaching.arm.swivel(reaching.goal)
    aside = reaching.arm.reach(
        reaching.task.goal + GOAL_OFFSETS, np.full(len(GOAL_OFFSETS), usual), reaching.goal
    )
    return [reaching.goal, *aside]


def contact_times(model: pdmp.Model, reaching: Reaching) -> list[float]:
    """Returns how long each reproduction, at demonstrated speed, touches its boxes [s]."""
    return [
        reach_over(model, reaching, height_of(demo), style, tau=model.tau).log.contact()
        for demo, style in zip(reaching.demos, model.styles, strict=True)
    ]


def figure_3(seed: int = SEED) -> Section:
    """Reproduces Fig. 3."""
    reaching = demonstrate(seed)
    model = learn(reaching)
    shares = model.singular_values / model.singular_values.sum()
    robots = {
        pile(height_of(reaching.demos[m])): reach_over(
            model, reaching, height_of(reaching.demos[m]), model.styles[m]
        )
        for m in DRAWN_TRIALS
    }
    lines = [
        [
            name,
            ", ".join(f"{s:.2f}" for s in model.styles[m]),
            f"{robot.log.contact():.3f} s",
            f"{reaching.miss(robot.log.hands[-1]):.2f} mm",
            f"{1e3 * robot.log.tracking_error():.1f} mrad",
        ]
        for m, (name, robot) in zip(DRAWN_TRIALS, robots.items(), strict=True)
    ]
    by_styles = []
    for n_styles in range(1, 5):
        contacts = np.reshape(
            contact_times(learn(reaching, n_styles), reaching), (len(HEIGHTS), -1)
        )
        clear = (contacts == 0).sum(axis=1)
        by_styles.append([n_styles, *(f"{n} of {contacts.shape[1]}" for n in clear)])
    text = [
        f"Fifteen reaches, {model.n_dofs} joints; the first three singular values have "
        f"{shares[:3].sum():.1%} of the sum, the first four {shares[:4].sum():.1%}. On the robot, "
        "tau = 0.6 s, to the goal as printed:",
        markdown_table(
            ["", "style", "contact with boxes", "distance to the goal", "largest tracking error"],
            lines,
        ),
        "Number of the three styles demonstrated over each pile that clear it, at demonstrated "
        "speed:",
        markdown_table(["J", *map(pile, HEIGHTS)], by_styles),
    ]
    section = Section(
        "Fig. 3: reaching over boxes",
        text,
        {
            "fig3_paths": draw_paths(model, reaching, robots),
            "fig3_joints": paths.joints(robots, until=6.0),
        },
    )
    rows = {name: (robot, FRAMES) for name, robot in robots.items()}
    return film.attach(section, "fig3_robot", rows, film.REACHING)


def draw_paths(model: pdmp.Model, reaching: Reaching, robots: dict[str, Robot]) -> Figure:
    """Draws the path of the hand from the side, for several styles and several goals."""
    figure = new_figure(9.5, 4.2)
    styles, goal_panel = figure.subplots(1, 2, sharey=True)
    tallest = max(HEIGHTS)
    for axes in (styles, goal_panel):
        paths.draw_boxes(axes, reaching, tallest, alpha=0.12)
    for demo in reaching.demos:
        hands = reaching.arm.hands(demo.position)
        paths.draw_hand(styles, reaching, hands, color=GREY, linewidth=0.8)
    for (name, robot), color in zip(robots.items(), PALETTE, strict=False):
        hands = np.array(robot.log.hands)
        paths.draw_hand(styles, reaching, hands, color=color, label=name)
    styles.plot([], [], color=GREY, linewidth=0.8, label="demonstrations")
    for goal, color in zip(goals(reaching), PALETTE[3:], strict=False):
        for m in DRAWN_TRIALS:
            moved = model.rollout(
                style=model.styles[m],
                goal=goal,
                start=reaching.start,
                velocity=np.zeros(model.n_dofs),
                duration=4.0,
            )
            hands = reaching.arm.hands(moved.position)
            paths.draw_hand(goal_panel, reaching, hands, color=color, linewidth=1.2)
        distance, height = reaching.side_view(reaching.arm.hands([goal]))
        goal_panel.plot(distance, height, "*", color=color, markersize=11)
    paths.label_side_view(styles, "styles, on the robot")
    paths.label_side_view(goal_panel, "goals (stars), each with these styles")
    styles.set_ylim(bottom=0)
    styles.legend(frameon=False, fontsize=8)
    return figure
