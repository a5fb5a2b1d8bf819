"""Prints contestants and machine, a table for each work, and one of all."""

import gc
import os
import platform
from importlib.metadata import PackageNotFoundError, version

from peers import factors, imitation, regression, rollouts, steps
from peers.arena import Work, machine, ratio, run, written

PACKAGES = [
    "pdmp",
    "movement_primitives",
    "pydmps",
    "ruckig",
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


def summary(results: list[tuple[Work, dict[str, float]]]) -> None:
    """Prints every ratio of the run in one table."""
    print(f"\n| {'work':<84} | {'contestant':<46} |  median |  ratio |")
    print(f"|{'-' * 86}|{'-' * 48}|--------:|-------:|")
    for work, medians in results:
        first = next(iter(medians.values()))
        titles = iter([work.title])
        for name, median in medians.items():
            figures = f"{written(median):>7} | {ratio(median, first):>6}"
            print(f"| {next(titles, ''):<84} | {name:<46} | {figures} |")


def main() -> None:
    """Prints contestants and machine, a table for each work, and one of all."""
    print(f"{machine()}, {os.cpu_count()} cores, Python {platform.python_version()}")
    print(", ".join(installed(package) for package in PACKAGES))
    gc.disable()
    results = []
    for work in [
        *steps.WORKS,
        *rollouts.WORKS,
        *imitation.WORKS,
        *regression.WORKS,
        *factors.WORKS,
    ]:
        gc.collect()
        results.append((work, run(work)))
    summary(results)


main()
