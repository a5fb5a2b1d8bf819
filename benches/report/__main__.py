"""Predicts movements from their contexts with primitives and with simpler predictors.

``make report`` prints the tables and draws figures into out/report/; ``--write`` writes
docs/report.md too.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from pdmp import TimeWarp, plot
from pdmp.evaluation import PDMP, Evaluation, baselines, evaluate, over_styles
from report.baselines import library_baselines
from report.sets import Question, questions
from report.text import PRIMITIVE, SELECTED, WARPED, text

ROOT = Path(__file__).resolve().parents[2]
FIGURES = ROOT / "out" / "report"
CURVES = {"raise_hand_bandai, whole", "walking_force_speed, subject 0"}
PRIMITIVES = {
    PRIMITIVE: PDMP(),
    "PDMP, full J": PDMP(singular_value_share=1.0),
    "PDMP, linear map": PDMP(map="linear"),
    SELECTED: PDMP(n_styles="auto"),
    WARPED: PDMP(alignment=TimeWarp(4)),
}


def main() -> None:
    """Evaluates every question whose recordings are available."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--write", action="store_true", help="write docs/report.md")
    write = arguments.parse_args().write
    available = list(questions())
    if not available:
        raise SystemExit("no recordings: set PDMP_DATA to a folder with sets of them")
    FIGURES.mkdir(parents=True, exist_ok=True)
    answers: list[tuple[Question, Evaluation]] = []
    with ProcessPoolExecutor() as pool:
        for question, evaluation in zip(available, pool.map(answer, available), strict=True):
            print(f"{question.name}\n\n{evaluation}\n", flush=True)
            answers.append((question, evaluation))
    report = text(answers)
    if write:
        (ROOT / "docs" / "report.md").write_text(report, encoding="utf-8")
    print(report)


def answer(question: Question) -> Evaluation:
    """Evaluates all predictors on one question, and draws their predictions."""
    options = {"contexts": question.contexts} | question.options
    predictors = baselines() | library_baselines() | PRIMITIVES
    evaluation = evaluate(question.demos, predictors=predictors, **options)
    figure = plot.held_out(evaluation, PRIMITIVE, unit=question.unit)
    plot.save(figure, FIGURES / f"{slug(question.name)}.png")
    if question.name in CURVES:
        curve = evaluate(question.demos, predictors=over_styles(8), **options)
        figure = plot.prediction_error(curve, unit=question.unit)
        plot.save(figure, FIGURES / f"{slug(question.name)}_styles.png")
    return evaluation


def slug(name: str) -> str:
    """Returns the name of a question as a file name."""
    return name.replace(", ", "_").replace(" ", "_")


if __name__ == "__main__":
    main()
