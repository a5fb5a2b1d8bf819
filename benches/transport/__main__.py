"""Measures transport and ends of discrete movements on the recordings.

``make bench-transport`` prints the tables; ``--write`` writes docs/transport.md and draws its
figures.
"""

import argparse
from pathlib import Path

from transport.ends import ends, rest
from transport.moves import errors
from transport.pictures import draw
from transport.straight import reach
from transport.tasks import tasks
from transport.text import text

DOCS = Path(__file__).resolve().parents[2] / "docs"


def main() -> None:
    """Measures every available task."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--write", action="store_true", help="write docs/transport.md")
    write = arguments.parse_args().write
    available = list(tasks())
    if not available:
        raise SystemExit("no recordings: set PDMP_DATA to a folder with sets of them")
    report = text(
        [end for task in available for end in ends(task)],
        [errors(task) for task in available],
        {transport: reach(transport) for transport in ("learnt", "immediate")},
        rest(),
    )
    print(report)
    if write:
        (DOCS / "transport.md").write_text(report, encoding="utf-8")
        draw(DOCS)


if __name__ == "__main__":
    main()
