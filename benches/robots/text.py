"""Text of docs/limits.md."""

from pdmp._markdown import markdown_table
from recordings import sources
from reproduction.baxter import ACCELERATION
from robots.arms import SHARE, Arms
from robots.commands import BEYOND, HOLD, INTERVAL, MAX_SPEED, RECOVERY, TAU
from robots.excess import Excess

INTRODUCTION = """\
# Limits on simulated robots

`make bench-robots` measures this; `PYTHONPATH=benches .venv/bin/python -m robots --write` updates
this file and its figure.

![The same command with and without limits, on two joints of a Panda](limits.png)

A reach gets a new goal, which is beyond the limit of the first joint, and half the time. With
limits, both joints slow down on the path, and the first one ends at its limit.

## Random commands

Each robot is simulated in MuJoCo with a model of robosuite 1.5.2 (MIT licence), without contacts,
and driven at 1 kHz by computed torque control from the position, velocity and acceleration of a
controller, which receives the measured position. The Panda has seven joints and the limits that
its maker publishes; the model's inertias are round numbers. Baxter moves four joints of each arm
within the published limits of position and velocity, and {acceleration:g} rad/s², as none is
published. The primitives are fitted to recordings, each column of which is shifted to the middle
of the range of its joint, and scaled down if it takes up more than {share:.0%} of it.

About once in {interval:g} s comes one of these commands: a goal, up to {beyond:.0%} of the range
beyond the limits; a style, of a demonstration or with twice the standard deviation of theirs; τ,
from {least:g} to {most:g} times that of the fit; a speed from 0, a pause, to {speed:g}; another
movement from the present position and velocity; or a joint is held for {hold[0]:g} to
{hold[1]:g} s.
"""
KINDS = ("with limits", "without")
TRACKING = """\
The excess of positions, at the ticks and between them, is over the range of the joint. A limit is
active if it slows the movement down on its path, or turns a joint off it. The acceleration is the
change of the commanded velocity over the tick, and a jump is its change by more than the limit from
one tick to the next. Tracking errors are those of the worst joint, and motors are counted, while
none is held nor was in the last {recovery:g} s; a command leads the measured position by one tick,
1.5 mrad at 1.5 rad/s.
"""


def text(results: list[tuple[Arms, int, float, Excess, Excess]]) -> str:
    """Returns the report.

    Parameters
    ----------
    results : list of (Arms, int, float, Excess, Excess)
        Each robot with the number of its style parameters, the simulated minutes, and the figures
        of a run with limits and of one without.
    """
    return "\n".join(
        [
            INTRODUCTION.format(
                acceleration=ACCELERATION,
                share=SHARE,
                interval=INTERVAL,
                beyond=BEYOND,
                least=TAU[0],
                most=TAU[1],
                speed=MAX_SPEED,
                hold=HOLD,
            ),
            table(results),
            "",
            TRACKING.format(recovery=RECOVERY),
            sources(arms.source for arms, *_ in results),
            "",
        ]
    )


def table(results: list[tuple[Arms, int, float, Excess, Excess]]) -> str:
    """Returns the figures, a column for each run."""
    header = ["", *(f"{arms.name.capitalize()}, {kind}" for arms, *_ in results for kind in KINDS)]
    runs = [run for *_, kept, free in results for run in (kept, free)]
    rows = [
        ["joints D, styles J", *(f"{len(a.joints)}, {n}" for a, n, *_ in results for _ in KINDS)],
        ["simulated time [min]", *(f"{m:g}" for _, _, m, *_ in results for _ in KINDS)],
        ["commands", *(run.n_commands for run in runs)],
        ["movements", *(run.n_movements for run in runs)],
        ["position, worst excess", *(f"{run.position:.1e}" for run in runs)],
        ["velocity / limit, worst", *(ratio(run.velocity) for run in runs)],
        ["acceleration / limit, worst", *(ratio(run.acceleration) for run in runs)],
        ["ticks with an active limit", *(f"{run.limited:.1%}" for run in runs)],
        ["ticks with a command that waits", *(f"{run.pending:.1%}" for run in runs)],
        ["ticks with a jump", *(f"{run.jumps:.1%}" for run in runs)],
        ["tracking error, median [mrad]", *(f"{1e3 * run.median:.2f}" for run in runs)],
        ["tracking error, worst [mrad]", *(f"{1e3 * run.worst:.2f}" for run in runs)],
        ["worst with a joint held [mrad]", *(f"{1e3 * run.held:.0f}" for run in runs)],
        ["ticks with a motor at its limit", *(f"{run.saturated:.1%}" for run in runs)],
    ]
    return markdown_table(header, rows)


def ratio(value: float) -> str:
    """Returns a ratio, with the excess over one if that is small."""
    return f"1 + {value - 1:.0e}" if 1 <= value < 1.001 else f"{value:.3g}"
