"""Prints libraries and machine, a table per task, and one of all ratios."""

import gc
import os
import platform
from importlib.metadata import PackageNotFoundError, version

from peers import factors, imitation, limits, poses, regression, rollouts, steps
from peers.timing import Task, machine, ratio, run, written

PACKAGES = [
    "pdmp",
    "movement_primitives",
    "pydmps",
    "pytransform3d",
    "ruckig",
    "klimits",
    "toppra",
    "mp_pytorch",
    "torch",
    "scikit-learn",
    "celerite2",
    "scipy",
    "numpy",
]


def installed(package: str) -> str:
    """Returns a package with its version."""
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        return f"{package} missing"


def summary(results: list[tuple[Task, dict[str, float]]]) -> None:
    """Prints every ratio of the run in one table."""
    print(f"\n| {'task':<84} | {'library':<46} |  median |  ratio |")
    print(f"|{'-' * 86}|{'-' * 48}|--------:|-------:|")
    for task, medians in results:
        first = next(iter(medians.values()))
        titles = iter([task.title])
        for name, median in medians.items():
            figures = f"{written(median):>7} | {ratio(median, first):>6}"
            print(f"| {next(titles, ''):<84} | {name:<46} | {figures} |")


def main() -> None:
    """Prints libraries and machine, a table per task, and one of all ratios."""
    print(f"{machine()}, {os.cpu_count()} cores, Python {platform.python_version()}")
    print(", ".join(installed(package) for package in PACKAGES))
    poses.reproduction()
    poses.rigidity()
    gc.disable()
    results = []
    for task in [
        *steps.TASKS,
        *limits.TASKS,
        *rollouts.TASKS,
        *imitation.TASKS,
        *regression.TASKS,
        *factors.TASKS,
        *poses.TASKS,
    ]:
        gc.collect()
        results.append((task, run(task)))
    summary(results)


main()
