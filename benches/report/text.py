"""Report in Markdown."""

from collections.abc import Iterable, Sequence
from typing import Any

import pdmp
from pdmp import TimeWarp
from pdmp._markdown import markdown_table
from pdmp.evaluation import Evaluation, baselines
from pdmp.evaluation.result import REFERENCE
from recordings import sources
from report.baselines import library_baselines
from report.sets import Question

PRIMITIVE = "PDMP"
SELECTED = "PDMP, J selected"
WARPED = "PDMP, warped time"
INTRODUCTION = """\
# Movements predicted from their context

`make report` prints these tables and draws figures into `out/report/`;
`PYTHONPATH=benches .venv/bin/python -m report --write` writes them here. Each condition is held out
in turn, or, with more than twelve conditions, each of twelve folds of neighbours; the others are
the training set, and the movement is predicted from the context alone. Contexts outside the convex
hull of the training contexts are extrapolation.

The primitive has its defaults: linear time scaling, automatic smoothing, the systematic J, and a
map from context to style, goal, start or anchor, and duration that stacks a Gaussian process and a
line. Four variants differ in one of these: all J, the linear map, J by cross-validation
(`n_styles="auto"`), and a time warp of four segments. The ProMP of movement_primitives is included
where that is installed.

## Errors of primitives and simpler predictors

E = (1/T) Σ‖ŷ(t) − y(t)‖² over normalised time, relative to that of the mean demonstration, ±
standard error over folds: 1 is no information from the context, 0 a perfect prediction.
"""
PRIMITIVE_ITSELF = """\
## Properties of the primitive

J and map of a fit to all demonstrations, and J by cross-validation; E with the default J, ±
standard deviation over folds; share of the positions inside the 90 % band; relative error of the
duration; and difference of E from the best of the simpler predictors, on the same folds, ± standard
error: negative where the primitive is better.

Where another predictor is better, contexts determine little of the movement. Walks of ten styles
differ by more than their speed, and the slowest and the fastest are predicted best by the mean; so
are the highest grabs of other actors. For the three doors within the hull of the other twelve, a
linear map of three coordinates is closer than a stack of a process and a line.
"""
TIME = """\
## Linear and warped time

Effect of a time warp: share of the first three singular values in the sum over all demonstrations,
with linear and with warped time; and E of the primitive with warped time less that with linear
time, on the same folds, ± standard error. Both errors are over normalised time, and so include
errors of timing. A warp aligns pauses and fast parts of a raised hand, which reduces the variation,
but the height of the hand hardly determines their times: movements predicted with mean times have
smaller errors.
"""


def text(answers: Sequence[tuple[Question, Evaluation]]) -> str:
    """Returns the report on all answers."""
    names = [name for name in answers[0][1].predictors if name != REFERENCE]
    errors, itself, time = [], [], []
    for question, evaluation in answers:
        chosen, shares = choices(question), spectra(question)
        for reach in evaluation.reaches():
            splits = [split for split in evaluation.splits if split.reach == reach]
            n_held_out = sum(len(split.test) for split in splits)
            cells = [question.name, reach]
            over_mean = [relative(evaluation, name, reach) for name in names]
            errors.append([*cells, question.context, f"{len(splits)}, {n_held_out}", *over_mean])
            itself.append([*cells, *chosen, *primitive(question, evaluation, reach)])
            if question.options.get("kind") != "rhythmic":
                gained = difference(evaluation, WARPED, PRIMITIVE, reach)
                time.append([*cells, *shares, f"{gained} {question.unit}²"])
    primitives = ["J", "J selected", "map", "E", "inside", "duration", "best other", "difference"]
    spectrum = ["first three, linear", "first three, warped", "difference"]
    tables = [
        (INTRODUCTION, ["context", "folds, demos", *names], errors),
        (PRIMITIVE_ITSELF, primitives, itself),
        (TIME, spectrum, time),
    ]
    lines = []
    for introduction, header, rows in tables:
        header = ["recordings", "reach", *header]
        lines += [introduction, markdown_table(header, rows, n_names=len(header)), ""]
    return "\n".join([*lines, sources(dict.fromkeys(asked.source for asked, _ in answers)), ""])


def relative(evaluation: Evaluation, name: str, reach: str) -> str:
    """Returns E over that of the mean demonstration."""
    if name in evaluation.skipped:
        return "–"
    summary = evaluation.summary(name, reach)
    return f"{summary.relative:.2g} ± {summary.relative_error:.1g}"


def primitive(question: Question, evaluation: Evaluation, reach: str) -> Iterable[str]:
    """Returns coverage of the band and error of the duration of the primitive."""
    summary = evaluation.summary(PRIMITIVE, reach)
    yield f"{summary.error:.2g} ± {summary.deviation:.1g} {question.unit}²"
    yield f"{summary.coverage:.0%}"
    yield f"{summary.duration:.0%}"
    others = [name for name in baselines() | library_baselines() if name not in evaluation.skipped]
    best = min(others, key=lambda name: evaluation.summary(name, reach).error)
    yield best
    yield difference(evaluation, PRIMITIVE, best, reach)


def difference(evaluation: Evaluation, one: str, other: str, reach: str) -> str:
    """Returns the difference of E of two predictors on the same folds."""
    compared = evaluation.compare(one, other, reach)
    return f"{compared.mean:.2g} ± {compared.standard_error:.1g}"


def choices(question: Question) -> tuple[str, str, str]:
    """Returns J, J by cross-validation, and the map of a primitive of all demonstrations."""
    model = learnt(question)
    return str(model.n_styles), str(learnt(question, n_styles="auto").n_styles), model.map.kind


def spectra(question: Question) -> tuple[str, str]:
    """Returns the share of the first three singular values, in linear and in warped time."""
    values = [
        learnt(question, alignment=alignment).singular_values
        for alignment in ("linear", TimeWarp(4))
    ]
    linear, warped = (f"{sigma[:3].sum() / sigma.sum():.1%}" for sigma in values)
    return linear, warped


def learnt(question: Question, **settings: Any) -> pdmp.Model:
    """Fits a primitive to all demonstrations."""
    kind = question.options.get("kind", "discrete")
    return pdmp.fit(question.demos, kind=kind, contexts=question.contexts, **settings)
