"""The report as Markdown."""

from pdmp.evaluation import Evaluation
from report.sets import Question

INTRODUCTION = """\
# Movements foreseen from their context

`make report` prints this; `--write` writes it. Demonstrations of one condition, or of neighbouring
ones where there are more than twelve, are held out; the others are learnt from, and the movement is
foreseen from the context alone. Figures are E = (1/T) Σ‖ŷ(t) − y(t)‖², over normalised time, as a
share of what the mean demonstration leaves, ± its standard error over folds: below 1 the context
tells something, at 0 all. What lies outside the convex hull of the contexts learnt from is
extrapolation.
"""


def text(answers: list[tuple[Question, Evaluation]]) -> str:
    """Write the table of all answers."""
    names = list(dict.fromkeys(name for _, found in answers for name in found.scores))
    header = ["recordings", "context", "reach", "folds", "demos", *names[1:]]
    lines = [header, ["---"] * 3 + ["--:"] * (len(header) - 3)]
    for question, found in answers:
        for reach in found.reaches():
            splits = [split for split in found.splits if split.reach == reach]
            counts = [len(splits), sum(len(split.test) for split in splits)]
            cells = [cell(found, name, reach) for name in names[1:]]
            lines.append([question.name, question.context, reach, *map(str, counts), *cells])
    return "\n".join([INTRODUCTION, *(f"| {' | '.join(line)} |" for line in lines), ""])


def cell(found: Evaluation, name: str, reach: str) -> str:
    """Write one figure."""
    if name not in found.scores:
        return "–"
    summary = found.summary(name, reach)
    return f"{summary.relative:.2g} ± {summary.relative_error:.1g}"
