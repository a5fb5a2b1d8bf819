"""Report in Markdown."""

from collections import defaultdict
from collections.abc import Iterable, Sequence

import numpy as np

from recordings import sources
from transport.ends import N_DURATIONS, REST, TOLERANCES, End
from transport.moves import MAX_TARGETS, Errors
from transport.straight import PHASES, Reach

INTRODUCTION = """\
# Transport and the end of a movement

`make bench-transport` prints these tables; `PYTHONPATH=benches .venv/bin/python -m transport
--write` writes them here and draws the figures. All recordings of discrete movements are used,
with all their samples and the defaults of `pdmp.fit`. *Rise* is the part of a raised hand until
it is held: it is cut where the hand still moves.

A discrete movement y moves about c(u) = y₀ + (g − y₀)·m(u), where the transport profile m is
learnt from the demonstrations. `transport="immediate"`, m ≡ 1, gives the paper's equations.

![Reaches with learnt and with immediate transport](transport.png)

![A handwritten N whose goal moves half way, with learnt and with immediate transport](control.png)

The goal of a handwritten N moves when half of the movement is done (orange). The black line is the
end of the movement.

In short:
"""
SUMMARY = """\
- Start and goal of another demonstration: the error is {ratio:.2f} of that of the paper's equations
  on average over {n_tasks} tasks, {sets:.2f} over {n_sets} sets.
- After the end, movements leave their goals by {excursion:.1f} % of their range or less in the
  median of each set, and by {hand:.1f} % in that of handwriting.
- They are `FINISHED` within {finished:.2f} of their duration in the median of each set of whole
  movements, those at rest within {at_rest:.2f} in the median and {slowest:.2f} at most.
- A straight reach to half the distance leaves the interval between start and goal by
  {outside:.1f} % of it. A goal ten ranges away causes no initial acceleration.
- A goal that moves causes at most {moved:.2f} of the acceleration that it causes in the paper.
"""
MOVES = """\
## Demonstrations moved to start and goal of another

Each demonstration of a task is moved to start and goal of each other one, which is left out of
the fit (of at most {max_targets} others, evenly spaced, in a large task). Mean squared error
over time, degrees of freedom and pairs, in linearly scaled time. The moved movement is the
demonstration plus the difference of two rollouts, so that the truncation of styles has no
effect. *Ratio*: the error with learnt relative to that with immediate transport. The other
columns are relative to the error of the demonstration that is not moved; minimum jerk is the
straight path from start to goal.
"""
MOVES_SUMMARY = """\
Over the {n_tasks} tasks the ratio is {mean:.3f} on average, {geometric:.3f} in the geometric
mean, and at most {largest:.3f}; over the means of the {n_sets} sets it is {sets:.3f} on average.
It exceeds 1.02 in {n_above}{above};
the standard error is that of the jackknife over the targets.
Learnt from the target too, the profile would have {hindsight:.3f} on average over the tasks and at
most {worst_hindsight:.3f}: little more can be learnt from these demonstrations.
"""
ENDS = """\
## Past the end

Each demonstration is reproduced for {n_durations} durations by a fit of its task. *Excursion*:
the largest distance |y − g| of a degree of freedom after the duration of the demonstration, in
percent of the range of the largest degree of freedom (of its own range in brackets). A range is
the largest peak-to-peak value within one demonstration of the task. *At rest*: demonstrations
whose end speed is at most {rest:.0f} % of the peak speed, after smoothing. *Braking*: the median
rate κ in units of α_z, and the largest deceleration past the end relative to the hardest
demonstrated acceleration of that degree of freedom. Medians and maxima are over the
demonstrations.

![Distance from the goal at the end of two movements](end.png)
"""
REST_SUMMARY = """\
Some people quicken at the last samples of handwriting. A demonstration at rest shares its styles
with others that end in motion, and their truncation leaves it a small velocity at the end.
Synthetic reaches that rest on their goal for the last tenth of their duration leave it by
{held:.0e} of their range; those that rest at the last of 101 samples alone, by {touched:.0e}.
"""
SETTLED = """\
## Time to finish

*Finished*: time at which a controller is `FINISHED`, relative to the duration of the
demonstration, with the default `tolerance` of 0.5 %. The other columns have the median time from
which |y − g| + 2τ|ẏ|/α_z stays below a share of the range of each degree of freedom: it bounds the
displacement that remains at critical damping. Brackets: the maximum over the demonstrations at
rest.
"""
STRAIGHT = """\
## Straight reaches

Fit of straight minimum-jerk reaches of length 0.9, 1 and 1.1. *Outside*: the farthest point of a
reach to half the distance beyond start or goal, in percent of that distance. The accelerations
are those of a reach to a goal ten ranges beyond the demonstrated one, relative to the largest
acceleration of moving by twelve ranges along m.
"""
MOVED = """\
The next table has the largest acceleration that a goal causes which moves by Δg during a reach of
duration T, in units of Δg/T², without and with the filter of commands (`transition`). It is a
property of the equations and does not depend on the recordings. A minimum-jerk movement from rest
to rest in T needs 5.8.
"""
PERTURBATION = """\
## A robot that is held, and one that sags

![A held and a sagging arm](perturbation.png)

A simulated joint follows the controller and returns its measured angle to it at 100 Hz, while
the controller ticks at 1 kHz. Held, the joint holds the movement back, and its phase nearly
stops; released, the movement continues from there. A constant load makes the other joint sag by
a constant angle: the movement ends on its goal and finishes, and the joint is no further from
the goal than its own error.
"""


def text(
    ends: Sequence[End], errors: Sequence[Errors], reaches: dict[str, Reach], rest: Iterable[float]
) -> str:
    """Returns the report."""
    held, touched = rest
    return "\n".join(
        [
            INTRODUCTION,
            summary(ends, errors, reaches),
            MOVES.format(max_targets=MAX_TARGETS),
            *moves_table(errors),
            moves_summary(errors),
            STRAIGHT,
            *straight_table(reaches),
            MOVED,
            *moved_table(reaches),
            ENDS.format(n_durations=N_DURATIONS, rest=100 * REST),
            *ends_table(by_source(ends)),
            REST_SUMMARY.format(held=held, touched=touched),
            SETTLED,
            *settled_table(by_source(ends)),
            PERTURBATION,
            sources(dict.fromkeys(end.source.partition(",")[0] for end in ends)),
            "",
        ]
    )


def summary(ends: Sequence[End], errors: Sequence[Errors], reaches: dict[str, Reach]) -> str:
    """Returns the main figures."""
    sets = by_source(ends)
    excursions, finished = (
        {
            source: float(np.median([getattr(end, field) for end in members]))
            for source, members in sets.items()
        }
        for field in ("excursion", "finished")
    )
    ratios = defaultdict(list)
    for task in errors:
        ratios[task.source].append(task.ratio)
    learnt, immediate = (
        np.array([reaches[name].at_once, reaches[name].filtered])
        for name in ("learnt", "immediate")
    )
    return SUMMARY.format(
        ratio=np.mean([task.ratio for task in errors]),
        n_tasks=len(errors),
        sets=np.mean([np.mean(members) for members in ratios.values()]),
        n_sets=len(ratios),
        excursion=100 * max(excursions.values()),
        hand=100 * excursions.get("handwriting", np.nan),
        finished=max(time for source, time in finished.items() if "rise" not in source.split(", ")),
        at_rest=np.median([end.finished for end in ends if end.is_at_rest]),
        slowest=max(end.finished for end in ends if end.is_at_rest),
        outside=100 * reaches["learnt"].outside,
        moved=(learnt / immediate).max(),
    )


def by_source(ends: Iterable[End]) -> dict[str, list[End]]:
    """Returns the ends of each set."""
    members = defaultdict(list)
    for end in ends:
        members[end.source].append(end)
    return members


def moves_table(errors: Sequence[Errors]) -> list[str]:
    """Returns a row per task; that of handwriting has the means over its shapes."""
    header = ["task", "demonstrations", "ratio", "learnt", "immediate", "minimum jerk"]
    rows = []
    shapes = [task for task in errors if task.source == "handwriting"]
    if shapes:
        count = sum(task.n_demos for task in shapes)
        rows.append([f"handwriting, mean of {len(shapes)} shapes", str(count), *means(shapes)])
    for task in errors:
        if task.source != "handwriting":
            name = ", ".join(filter(None, (task.source, task.name)))
            rows.append([name, str(task.n_demos), *means([task])])
    return table(header, rows)


def means(tasks: Sequence[Errors]) -> list[str]:
    """Returns the means of the relative errors of some tasks."""
    relative = [
        (
            task.ratio,
            task.learnt / task.unmoved,
            task.immediate / task.unmoved,
            task.minimum_jerk / task.unmoved,
        )
        for task in tasks
    ]
    ratio, *others = np.mean(relative, axis=0)
    return [f"{ratio:.3f}", *(f"{other:.2f}" for other in others)]


def moves_summary(errors: Sequence[Errors]) -> str:
    """Returns the summary over tasks."""
    ratios = np.array([task.ratio for task in errors])
    sets = defaultdict(list)
    for task in errors:
        sets[task.source].append(task.ratio)
    above = [
        f"{task.source} {task.name} ({task.ratio:.3f} ± {task.standard_error:.3f})"
        for task in errors
        if task.ratio > 1.02
    ]
    hindsight = [task.hindsight / task.immediate for task in errors]
    return MOVES_SUMMARY.format(
        n_tasks=len(errors),
        mean=ratios.mean(),
        geometric=np.exp(np.log(ratios).mean()),
        largest=ratios.max(),
        n_sets=len(sets),
        sets=np.mean([np.mean(members) for members in sets.values()]),
        n_above=len(above) or "none",
        above=f": {', '.join(above)}" if above else "",
        hindsight=np.mean(hindsight),
        worst_hindsight=max(hindsight),
    )


def straight_table(reaches: dict[str, Reach]) -> list[str]:
    """Returns a row per kind of transport."""
    header = ["transport", "outside [%]", "initial acceleration", "largest acceleration"]
    rows = [
        [name, f"{100 * reach.outside:.1f}", f"{reach.initial:.2f}", f"{reach.largest:.2f}"]
        for name, reach in reaches.items()
    ]
    return table(header, rows)


def moved_table(reaches: dict[str, Reach]) -> list[str]:
    """Returns a row per phase at which the goal moves."""
    header = ["goal moved at"]
    columns: list[Sequence[float]] = []
    for filter_name, field in (("at once", "at_once"), ("filtered", "filtered")):
        header += [f"{name}, {filter_name}" for name in reaches]
        columns += [getattr(reach, field) for reach in reaches.values()]
    rows = [
        [f"{phase:g} T", *(f"{value:.1f}" for value in row)]
        for phase, *row in zip(PHASES, *columns, strict=True)
    ]
    return table(header, rows)


def ends_table(sets: dict[str, list[End]]) -> list[str]:
    """Returns the excursions, a row per set."""
    header = ["set", "demonstrations", "at rest", "range", "excursion [%], median", "maximum"]
    rows = []
    for source, members in sets.items():
        share, own = (
            100 * np.array([getattr(end, name) for end in members])
            for name in ("excursion", "own_excursion")
        )
        extents = np.unique([f"{end.range:.2g}" for end in members]).astype(float)
        extent = f"{extents.min():.2g}"
        if extents.max() > extents.min():
            extent += f" – {extents.max():.2g}"
        rows.append(
            [
                source,
                str(len(members)),
                str(sum(end.is_at_rest for end in members)),
                extent,
                f"{np.median(share):.2f} ({np.median(own):.2f})",
                f"{share.max():.1f} ({own.max():.1f})",
                f"{np.median([end.braking for end in members]):.1f}",
                f"{max(end.deceleration for end in members):.2f}",
            ]
        )
    return table([*header, "κ / α_z", "deceleration"], rows)


def settled_table(sets: dict[str, list[End]]) -> list[str]:
    """Returns the times to finish, a row per set."""
    tolerances = [f"{100 * tolerance:g} %" for tolerance in TOLERANCES]
    header = ["set", "finished, median", "maximum", *tolerances]
    rows = []
    for source, members in sets.items():
        # One row per demonstration: its time to finish, then those to settle to each tolerance.
        times, at_rest = (
            np.array([[end.finished, *end.settled] for end in some])
            for some in (members, [end for end in members if end.is_at_rest])
        )
        cells = [f"{time:.2f}" for time in np.median(times, axis=0)]
        if len(at_rest):
            largest = at_rest.max(axis=0)
            cells = [f"{cell} ({time:.2f})" for cell, time in zip(cells, largest, strict=True)]
        rows.append([source, cells[0], f"{times[:, 0].max():.2f}", *cells[1:]])
    return table(header, rows)


def table(header: list[str], rows: list[list[str]]) -> list[str]:
    """Returns the lines of a table in Markdown: names aligned left, numbers right."""
    align = ["---"] + ["---:"] * (len(header) - 1)
    return [f"| {' | '.join(row)} |" for row in [header, align, *rows]] + [""]
