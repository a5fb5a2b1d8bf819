"""Recognises one of two partners on the way, and generates the other, beside simpler predictors."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

import pdmp
from pdmp import Demonstration
from pdmp._markdown import markdown_table
from recordings import is_available, recorded, rows, walking_strides
from report.observed import MAX_FOLDS, SHARES, Simple, sampled, shown

LEFT_ARM = ["l_sh1", "l_sh2", "l_sh3", "l_elb"]
RIGHT_ARM = ["r_sh1", "r_sh2", "r_sh3", "r_elb"]
RIGHT_LEG = ["r_hip_flex", "r_knee_flex", "r_ank_dorsi"]
LEFT_LEG = ["l_hip_flex", "l_knee_flex", "l_ank_dorsi"]
NAMES = ("recogniser", "recogniser, true time", "nearest, true time", "mean")


@dataclass(frozen=True, eq=False)
class Partners:
    """Joint movements, whose first degrees of freedom are observed and the others generated."""

    name: str
    demos: list[Demonstration]
    n_observed: int


def sets() -> Iterator[Partners]:
    """Yields the available sets."""
    if is_available("arms_hdm05"):
        index = rows("arms_hdm05")
        demos = recorded("arms_hdm05", [*LEFT_ARM, *RIGHT_ARM])
        for motion in ("throwBasketball", "depositFloorR", "grabHighR"):
            own = [demo for demo, row in zip(demos, index, strict=True) if row["motion"] == motion]
            yield Partners(f"arms_hdm05, {motion}: left arm seen, right arm generated", own, 4)
    if is_available("walk_styles_bandai"):
        walks = [demo for _, demo in walking_strides([*RIGHT_LEG, *LEFT_LEG], stride="0")]
        yield Partners("walk_styles_bandai: right leg seen, left leg generated", walks, 3)


def errors(partners: Partners) -> np.ndarray:
    """Returns the errors (N, shares, predictors) of the generated partner, each left out."""
    demos, n_folds = partners.demos, min(MAX_FOLDS, len(partners.demos))
    found = []
    for first in range(n_folds):
        held_out = range(first, len(demos), n_folds)
        training = [demo for m, demo in enumerate(demos) if m not in held_out]
        kind = "rhythmic" if "walk" in partners.name else "discrete"
        model = pdmp.fit(training, kind=kind)
        prior, simple = model.prior(training), Simple(training)
        found += [one(model, prior, simple, demos[m], partners.n_observed) for m in held_out]
    return np.array(found)


def one(
    model: pdmp.Model, prior: pdmp.Prior, simple: Simple, demo: Demonstration, n_observed: int
) -> np.ndarray:
    """Returns the errors (shares, predictors) of one movement."""
    time, position = sampled(demo)
    duration = demo.time[-1] - demo.time[0]
    seen = position.copy()
    seen[:, n_observed:] = np.nan
    unknown, known = model.recogniser(prior), model.recogniser(prior, duration=duration)
    found = []
    for n in shown([unknown, known], time, seen, duration):
        predictions = [each.continuation(time[n:]).position for each in (unknown, known)]
        predictions += simple.predict(time, seen[:n], duration)[:2]
        rests = [each[:, n_observed:] - position[n:, n_observed:] for each in predictions]
        found.append([np.sqrt(np.mean(rest**2)) for rest in rests])
    return np.array(found)


def section() -> str:
    """Returns the tables of all available sets."""
    parts = [INTRODUCTION]
    for partners in sets():
        means = errors(partners)
        header = ["", *(f"{share:.0%} seen" for share in SHARES)]
        lines = [
            [name, *(f"{value:.3f}" for value in row)]
            for name, row in zip(NAMES, means.mean(axis=0).T, strict=True)
        ]
        title = f"### {partners.name}, {len(means)} movements"
        parts.append(f"{title}\n\n{markdown_table(header, lines, n_names=1)}\n")
        print(parts[-1], flush=True)
    return "\n".join(parts)


INTRODUCTION = """\
## Two partners

Both arms, or both legs, are in one model. One partner is seen, the other is NaN: the rows give the
root mean square error of the positions to come of the other, in rad, tenths left out. The nearest
demonstration is that whose seen partner has the smallest squared distance so far.
A throw and a walk take both partners. To deposit and to grab take one arm, which the other says
little about: the prediction is then no better than the mean movement, and the unknown time costs
most of it. [An example](gallery/14_handover.md) has the calls.
"""
