"""The report as Markdown."""

from collections.abc import Iterable, Sequence

import pdmp
from pdmp.evaluation import Evaluation
from pdmp.evaluation.result import REFERENCE
from report.sets import Question

PRIMITIVE = "PDMP"
PROCESSES = "PCA, Gaussian processes"
INTRODUCTION = """\
# Movements foreseen from their context

`make report` prints these tables and draws figures into `report/`;
`PYTHONPATH=benches .venv/bin/python -m report --write` puts them here. Each condition is held out
in turn, or, where there are more than twelve, each of twelve folds of neighbouring ones; the others
are learnt from, and the movement is foreseen from the context alone. What lies outside the convex
hull of the contexts learnt from is extrapolation.

The primitive aligns demonstrations by linear time scaling, and its map from context to style, goal,
start or anchor, and duration is the one that it chooses by itself. Its J keeps nine tenths of the
sum of the singular values. The columns J and map are those of all demonstrations of a question
together.

## Error beside simpler predictors

E = (1/T) Σ‖ŷ(t) − y(t)‖² over normalised time, as a share of what the mean demonstration leaves, ±
standard error over folds: at 1 the context told nothing, at 0 all.
"""
PRIMITIVE_ITSELF = """\
## The primitive itself

E with J by spectrum, ± standard deviation over folds; share of the positions inside its 90 % band;
how far off the duration is; and E less that of the Gaussian processes on principal components, on
the same folds, ± standard error: negative where the primitive is better.
"""


def text(answers: Sequence[tuple[Question, Evaluation]]) -> str:
    """Write the tables of all answers."""
    names = [name for name in answers[0][1].predictors if name != REFERENCE]
    errors, itself = [], []
    for question, found in answers:
        for reach in found.reaches():
            splits = [split for split in found.splits if split.reach == reach]
            held = sum(len(split.test) for split in splits)
            asked = [question.name, reach]
            shares = [relative(found, name, reach) for name in names]
            errors.append([*asked, question.context, f"{len(splits)}, {held}", *shares])
            itself.append([*asked, *choices(question), *primitive(question, found, reach)])
    return "\n".join(
        [
            INTRODUCTION,
            *table(["recordings", "reach", "context", "folds, demos", *names], errors),
            "",
            PRIMITIVE_ITSELF,
            *table(
                ["recordings", "reach", "J", "map", "E", "inside", "duration", "difference"], itself
            ),
            "",
        ]
    )


def relative(found: Evaluation, name: str, reach: str) -> str:
    """Write E over that of the mean demonstration."""
    if name in found.left_out:
        return "–"
    summary = found.summary(name, reach)
    return f"{summary.relative:.2g} ± {summary.relative_error:.1g}"


def primitive(question: Question, found: Evaluation, reach: str) -> Iterable[str]:
    """Write what the primitive alone knows."""
    summary = found.summary(PRIMITIVE, reach)
    yield f"{summary.error:.2g} ± {summary.deviation:.1g} {question.unit}²"
    yield f"{summary.coverage:.0%}"
    yield f"{summary.duration:.0%}"
    if PROCESSES in found.left_out:
        yield "–"
    else:
        compared = found.compare(PRIMITIVE, PROCESSES, reach)
        yield f"{compared.mean:.2g} ± {compared.standard_error:.1g}"


def choices(question: Question) -> tuple[str, str]:
    """Write J and the map of a primitive of all demonstrations."""
    kind = question.options.get("kind", "discrete")
    model = pdmp.fit(question.demos, kind=kind, contexts=question.contexts)
    return str(model.n_styles), model.map.kind


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Write a table in Markdown."""
    return [f"| {' | '.join(row)} |" for row in (header, ["---"] * len(header), *rows)]
