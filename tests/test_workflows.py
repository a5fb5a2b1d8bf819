"""The workflows call targets and files that exist, and pin what they run."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_make_targets_and_files_exist(path: Path) -> None:
    """A renamed target or program fails here, not in the workflow."""
    text = path.read_text(encoding="utf-8")
    targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M)
    called = re.findall(r"\bmake ([\w-]+)", text)
    assert set(called) <= set(targets)
    for program in re.findall(r"(?<![\w/])\.ci/[\w.]+", text):
        assert (ROOT / program).is_file(), program
    packages = re.findall(r"--package ([\w-]+)", text)
    crates = {folder.name for folder in (ROOT / "crates").iterdir()}
    assert set(packages) <= crates


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_actions_are_pinned(path: Path) -> None:
    """A tag of an action can be moved to other code, a commit cannot."""
    uses = re.findall(r"uses: (\S+)", path.read_text(encoding="utf-8"))
    assert uses
    assert all(re.fullmatch(r"[\w./-]+@[0-9a-f]{40}", action) for action in uses)


def test_workflows_call_make() -> None:
    """The test above would pass if it found no call."""
    texts = [path.read_text(encoding="utf-8") for path in WORKFLOWS]
    assert {"test", "docs", "packages"} <= set(re.findall(r"\bmake ([\w-]+)", " ".join(texts)))
