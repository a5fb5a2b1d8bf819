"""Drives two simulated robots by random commands within their joint limits.

``make bench-robots`` prints the table; ``--write`` writes docs/limits.md and draws its figure.
"""

import argparse
from pathlib import Path

from recordings import is_available
from robots.arms import ROBOTS
from robots.commands import run
from robots.excess import excess
from robots.pictures import draw
from robots.text import text

DOCS = Path(__file__).resolve().parents[2] / "docs"
SEED = 2011


def main() -> None:
    """Measures every robot whose recordings are available."""
    parser = argparse.ArgumentParser(prog="robots", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10, help="simulated time of each run")
    parser.add_argument("--write", action="store_true", help="write docs/limits.md")
    arguments = parser.parse_args()
    results = []
    for make in ROBOTS.values():
        arms = make()
        if is_available(arms.source):
            model = arms.model()
            with_limits, without = (
                excess(run(arms, model, 60 * arguments.minutes, SEED, limits), arms.limits)
                for limits in (arms.limits, None)
            )
            results.append((arms, model.n_styles, arguments.minutes, with_limits, without))
    if not results:
        raise SystemExit("no recordings: set PDMP_DATA to a folder with sets of them")
    report = text(results)
    print(report)
    if arguments.write:
        (DOCS / "limits.md").write_text(report, encoding="utf-8")
        draw(DOCS / "limits.png")


if __name__ == "__main__":
    main()
