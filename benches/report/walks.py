"""Recognises walks that are joined at any phase, beside simpler predictors."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

import pdmp
from pdmp import Demonstration
from pdmp._markdown import markdown_table
from recordings import ARM, is_available, rows, running_strides, walking_strides
from report.observed import BAND, MAX_FOLDS, SHARES
from report.sets import LEGS, STRIDES

N_SAMPLES = 60  # of a stride
PHASES = np.linspace(0, 1, 50, endpoint=False)  # of nearest strides
ERRORS = (
    "recogniser",
    "recogniser, true period",
    "nearest, true period",
    "mean, true period and phase",
)


@dataclass(frozen=True, eq=False)
class Walks:
    """Strides with the person or recording of each."""

    name: str
    demos: list[Demonstration]
    groups: list[str]

    def folds(self, by_group: bool) -> list[list[int]]:
        """Returns the strides to leave out together."""
        names = sorted(set(self.groups))
        numbers = [names.index(group) for group in self.groups]
        fold = numbers if by_group else range(len(self.demos))
        n = min(MAX_FOLDS, len(names) if by_group else len(self.demos))
        return [[m for m, number in enumerate(fold) if number % n == k] for k in range(n)]


def sets() -> Iterator[Walks]:
    """Yields the available sets."""
    if is_available("walk_styles_bandai"):
        strides, demos = zip(*walking_strides([*ARM, *LEGS], foot="r"), strict=True)
        yield Walks("walk_styles_bandai", list(demos), [stride["id"] for stride in strides])
    if is_available("running_strides"):
        index, strides = rows("running_strides"), running_strides()
        seen: dict[str, int] = {}
        own = []
        for m, row in enumerate(index):
            seen[row["runner"]] = seen.get(row["runner"], 0) + 1
            if seen[row["runner"]] <= STRIDES:
                own.append(m)
        runners = [index[m]["runner"] for m in own]
        yield Walks("running_strides", [strides[m] for m in own], runners)


def on_cycle(position: np.ndarray, phases: np.ndarray) -> np.ndarray:
    """Interpolates closed cycles (..., S, D) at fractions of the cycle (T,), of any turn."""
    n = position.shape[-2]
    places = phases % 1 * n
    below = places.astype(int) % n
    share = (places - np.floor(places))[:, None]
    return (1 - share) * position[..., below, :] + share * position[..., (below + 1) % n, :]


def nearest(strides: np.ndarray, seen: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """Continues the stride (M, S, D), at the phase, of the smallest squared distance so far."""
    past = np.arange(len(seen)) / N_SAMPLES
    distances = [
        np.sum((on_cycle(strides, phase + past) - seen) ** 2, axis=(1, 2)) for phase in PHASES
    ]
    phase, stride = np.unravel_index(np.argmin(distances), (len(PHASES), len(strides)))
    return on_cycle(strides[stride], PHASES[phase] + ahead)


def one(
    model: pdmp.Model, prior: pdmp.Prior, strides: np.ndarray, demo: Demonstration, begin: float
) -> np.ndarray:
    """Returns errors of the next stride, of phase and log period, and coverage (shares, 7)."""
    n = demo.n_samples
    period = demo.time[-1] * n / (n - 1)
    unknown, known = model.recogniser(prior), model.recogniser(prior, duration=period)
    found = []
    n_seen = 0
    for share in SHARES:
        while n_seen <= share * N_SAMPLES:
            observed = on_cycle(demo.position, np.array([begin + n_seen / N_SAMPLES]))[0]
            for recogniser in (unknown, known):
                recogniser.update(n_seen / N_SAMPLES * period, observed)
            n_seen += 1
        ahead = (n_seen - 1 + np.arange(1, N_SAMPLES + 1)) / N_SAMPLES
        rest = on_cycle(demo.position, begin + ahead)
        seen = on_cycle(demo.position, begin + np.arange(n_seen) / N_SAMPLES)
        predicted = unknown.continuation(ahead * period)
        positions = [predicted.position, known.continuation(ahead * period).position]
        positions += [nearest(strides, seen, ahead), on_cycle(strides.mean(0), begin + ahead)]
        estimate = unknown.estimate()
        late = estimate.fraction - begin - (n_seen - 1) / N_SAMPLES
        found.append(
            [
                *(np.sqrt(np.mean((each - rest) ** 2)) for each in positions),
                abs((late + 0.5) % 1 - 0.5),
                abs(np.log(estimate.duration / period)),
                np.mean(np.abs(predicted.position - rest) < BAND * predicted.deviation),
            ]
        )
    return np.array(found)


def evaluated(walks: Walks, by_group: bool, most: int) -> np.ndarray:
    """Returns the errors (N, shares, 7) of held-out strides, each from a random phase."""
    rng = np.random.default_rng(0)
    step = max(1, -(-len(walks.demos) // most))
    found = []
    for fold in walks.folds(by_group):
        training = [m for m in range(len(walks.demos)) if m not in fold]
        demos = [walks.demos[m] for m in training]
        model = pdmp.fit(demos, kind="rhythmic")
        groups = [walks.groups[m] for m in training] if by_group else None
        prior = model.prior(demos, groups=groups)
        phases = np.arange(4 * N_SAMPLES) / (4 * N_SAMPLES)
        strides = np.array([on_cycle(demo.position, phases) for demo in demos])
        for m in fold[::step]:
            found.append(one(model, prior, strides, walks.demos[m], rng.uniform()))
    return np.array(found)


def section(most: int) -> str:
    """Returns the tables of all available sets."""
    parts = [INTRODUCTION]
    for walks in sets():
        for by_group in (False, True):
            errors = evaluated(walks, by_group, most)
            *positions, phase, period, covered = errors.mean(axis=0).T
            header = ["", *(f"{share:.0%} seen" for share in SHARES)]
            lines = [
                [name, *(f"{value:.3f}" for value in row)]
                for name, row in zip(ERRORS, positions, strict=True)
            ]
            lines.append(["error of the phase, in strides", *(f"{x:.3f}" for x in phase)])
            lines.append(["error of log T", *(f"{value:.3f}" for value in period)])
            lines.append(["coverage, positions", *(f"{value:.0%}" for value in covered)])
            left_out = "people or recordings" if by_group else "tenths"
            title = f"### {walks.name}: {left_out} left out, {len(errors)} strides"
            parts.append(f"{title}\n\n{markdown_table(header, lines, n_names=1)}\n")
            print(parts[-1], flush=True)
    return "\n".join(parts)


INTRODUCTION = """\
## Walks from an unknown phase

A stride is joined at a random phase. The rows give the root mean square error of the positions of
the stride that follows what was seen, in rad, and the errors of phase and period. The nearest
stride is that, at the phase, with the smallest squared distance so far. The strides of
running_strides have one period.
"""
