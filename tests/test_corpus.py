"""Files that once exposed faults of readers, or that reach deep into them, are handled."""

from pathlib import Path

import pytest

import readers

CASES = [(path.parent.name, path) for path in sorted(readers.CORPUS.glob("*/*"))]


@pytest.mark.parametrize(
    ("target", "path"),
    [case for case in CASES if case[0] in readers.READERS],
    ids=lambda part: part.name if isinstance(part, Path) else part,
)
def test_a_damaged_file_is_rejected_or_read_in_finite_numbers(target: str, path: Path) -> None:
    """A file of the corpus is a ValueError, an OSError, or demonstrations in finite numbers."""
    readers.check(target, path)


def test_each_reader_has_a_corpus() -> None:
    """Every fuzz target has a corpus."""
    assert {target for target, _ in CASES} >= readers.READERS.keys()
