"""Comparison of bases: reproduction of recordings, and prediction of held-out samples.

``make bench-bases`` prints the tables; ``--write`` puts them into docs/bases.md.
"""

import argparse
from collections import defaultdict
from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path
from time import perf_counter

import numpy as np

import pdmp
from pdmp._markdown import markdown_table
from peers.timing import machine
from recordings import Group, groups, sources

KERNELS = ("matern32", "matern52")
SIZES = (20, 35, 50, 75, 100, 150, 200)
WIDTHS = (1.0, 1.2, 1.5)
N_SAMPLES = 4000  # samples of a rollout; linear interpolation between them is exact to 1e-6

Basis = pdmp.GP | pdmp.NGnet


def named(*bases: Basis) -> dict[str, Basis]:
    """Returns regressors by name."""
    return {
        f"GP, {basis.kernel}"
        if isinstance(basis, pdmp.GP)
        else f"NGnet, N = {basis.n_basis}, width {basis.overlap}": basis
        for basis in bases
    }


DEFAULTS = named(pdmp.GP(), pdmp.NGnet())
BASES = named(
    *map(pdmp.GP, KERNELS),
    *(pdmp.NGnet(*pair) for pair in product(SIZES, WIDTHS)),
    *DEFAULTS.values(),
)

FIGURES = ["reproduction, median", "worst", "held out", "log density", "fit [ms]"]
CAPTION = """\
Measured on {machine} by `make bench-bases`: {sets} sets of recordings, {groups} groups of
repetitions, {demos} demonstrations, at most ten per group and 400 samples each. Defaults are bold.

- *Reproduction*: a primitive is fitted to a group with J = M, and each demonstration is reproduced
  by a rollout of its conditions. RMSE at its samples over the largest range of a degree of freedom:
  median over sets of the median over the demonstrations of a set, and maximum.
- *Held out*: the basis targets of the group are regressed on every second sample and compared at
  the others. RMSE over the largest range of the targets, and log density of a value in units of the
  RMS of the targets: medians over sets of the medians over the groups of a set. The variance and
  noise of a Gaussian process are its own; the variance of a network is the mean square of its
  leave-one-out residuals at the training samples.
- *Fit*: time of `pdmp.fit`, all four steps: median over groups.

The defaults follow from these results. The Gaussian process has the smallest reproduction error and
needs no N. Matérn-5/2 has smaller errors than 3/2 on 12 of the 15 sets, by up to a half, and is
smoother; 3/2 predicts as well, with a higher log density. Networks of 75 to 100 functions have
smaller reproduction errors, but predict cycles of twenty samples worse; 50 functions of width 1.2
are a compromise.
"""


@dataclass(frozen=True)
class Score:
    """Errors of one basis on one group."""

    reproduction: list[float]  # RMSE over range, of each demonstration
    held_out: float  # RMSE over range of the targets
    density: float  # log density of a value, in units of the targets' RMS
    seconds: float


def score(group: Group, basis: Basis) -> Score:
    """Fits a basis to a group and computes its errors."""
    begin = perf_counter()
    model = pdmp.fit(
        group.demos, kind=group.kind, n_styles=len(group.demos), basis=basis, smoothing=None
    )
    seconds = perf_counter() - begin
    return Score(reproduction(model, group), *held_out(group, basis), seconds)


def reproduction(model: pdmp.Model, group: Group) -> list[float]:
    """Returns the RMSE over range of every demonstration, from a rollout of its conditions."""
    errors = []
    for m, demo in enumerate(group.demos):
        rollout = model.rollout(model.conditions(m), dt=model.durations[m] / N_SAMPLES)
        # Recordings with missing samples have time stamps.
        sampled = [np.interp(demo.time, rollout.time, column) for column in rollout.position.T]
        difference = np.transpose(sampled) - demo.position
        errors.append(np.sqrt(np.mean(difference**2)) / np.ptp(demo.position, axis=0).max())
    return errors


def held_out(group: Group, basis: Basis) -> tuple[float, float]:
    """Returns RMSE over range and log density of every second sample from a fit to the others."""
    u, factors, extent = targets(group)
    periodic = group.kind == "rhythmic"
    training = slice(0, None, 2)
    # Samples beyond the last training sample would be extrapolation.
    hidden = slice(1, None if periodic else len(u[training]) * 2 - 2, 2)
    learnt = basis.regress(u[training], factors[training], periodic=periodic)
    mean, variance = learnt.predict(u[hidden])
    error = factors[hidden] - mean
    if variance is None:
        variance = np.mean(skipped(basis, u[training], factors[training], periodic) ** 2)
    else:
        variance = variance + learnt.noise * learnt.signal_variance
    unit = np.mean(factors**2)
    density = -0.5 * (np.log(2 * np.pi * variance / unit) + error**2 / variance)
    return rmse(error, group) / extent, float(np.mean(density))


def skipped(net: pdmp.NGnet, u: np.ndarray, targets: np.ndarray, periodic: bool) -> np.ndarray:
    """Returns the leave-one-out residuals (C, P) of a network.

    The network is linear, f̂ = Hf; its leave-one-out residual is (fᵢ − f̂ᵢ)/(1 − Hᵢᵢ).
    """
    missed = targets - net.regress(u, targets, periodic=periodic).predict(u)[0]
    hat = net.regress(u, np.eye(len(u)), periodic=periodic).predict(u)[0]
    return missed / (1 - np.diag(hat))[:, None]


def rmse(error: np.ndarray, group: Group) -> float:
    """Returns the RMSE over demonstrations: squares of factors of orthonormal styles add up."""
    n_values = len(error) * len(group.demos) * group.demos[0].n_dofs
    return float(np.sqrt(np.sum(error**2) / n_values))


@cache
def targets(group: Group) -> tuple[np.ndarray, np.ndarray, float]:
    """Returns the clock (C,), the basis targets (C, J·D) and the largest range of the targets.

    The landscape of a rough process with minimal noise interpolates the targets.
    """
    exact = pdmp.GP("matern32", noise=1e-10)
    model = pdmp.fit(
        group.demos, kind=group.kind, n_styles=len(group.demos), basis=exact, smoothing=None
    )
    count = group.demos[model.nominal].n_samples
    if model.kind == "discrete":
        u = np.linspace(0, model.durations[model.nominal] / model.tau, count)
        gate = np.exp(-model.alpha_x * u)[:, None, None]
    else:
        u, gate = 2 * np.pi * np.arange(count) / count, 1.0
    factors = gate * model.landscape(u)
    demonstrated = np.einsum("mj,cjd->mcd", model.styles, factors)
    return u, factors.reshape(count, -1), float(np.ptp(demonstrated, axis=(0, 1)).max())


def over_sets(scores: dict[Group, Score]) -> list[str]:
    """Returns the results of one basis: medians over sets, the maximum, the median time."""
    sets = defaultdict(list)
    for group, result in scores.items():
        sets[group.source].append(result)
    medians = [
        (
            np.median([error for result in members for error in result.reproduction]),
            np.median([result.held_out for result in members]),
            np.median([result.density for result in members]),
        )
        for members in sets.values()
    ]
    reproduced, held_out, density = np.median(medians, axis=0)
    worst = max(error for result in scores.values() for error in result.reproduction)
    seconds = np.median([result.seconds for result in scores.values()])
    shares = [f"{share:.1e}" for share in (reproduced, worst, held_out)]
    return [*shares, f"{density:.2f}", f"{1e3 * seconds:.3g}"]


def report(scores: dict[str, dict[Group, Score]]) -> str:
    """Returns the report in Markdown."""
    seen = list(next(iter(scores.values())))
    lines = ["# Bases, compared on recordings", ""]
    lines.append(
        CAPTION.format(
            machine=machine(),
            sets=len({group.source for group in seen}),
            groups=len(seen),
            demos=sum(len(group.demos) for group in seen),
        )
    )
    for kind in ("discrete", "rhythmic"):
        rows = []
        for name, group_scores in scores.items():
            of_kind = {group: score for group, score in group_scores.items() if group.kind == kind}
            if of_kind:
                mark = "**" if name in DEFAULTS else ""
                rows.append([f"{mark}{name}{mark}", *over_sets(of_kind)])
        table = markdown_table(["basis", *FIGURES], rows)
        lines += [f"## {kind.capitalize()} movements", "", table, ""]
    lines += ["## The defaults, set by set", ""]
    rows = []
    for source in dict.fromkeys(group.source for group in seen):
        for name in DEFAULTS:
            of_set = {group: s for group, s in scores[name].items() if group.source == source}
            rows.append([source, name, *over_sets(of_set)])
    lines += [markdown_table(["set", "basis", *FIGURES], rows, n_names=2), ""]
    lines += [sources(dict.fromkeys(group.source for group in seen)), ""]
    return "\n".join(lines)


def main() -> None:
    """Scores every basis on every group, and prints or writes the tables."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--write", action="store_true", help="write docs/bases.md")
    write = arguments.parse_args().write
    scores: dict[str, dict[Group, Score]] = {name: {} for name in BASES}
    for group in groups():
        for name, basis in BASES.items():
            scores[name][group] = score(group, basis)
    if write:
        (Path(__file__).parents[1] / "docs" / "bases.md").write_text(report(scores))
    else:
        print(report(scores))


if __name__ == "__main__":
    main()
