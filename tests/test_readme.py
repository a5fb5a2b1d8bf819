"""The README is correct."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_every_snippet_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The Python snippets run in order, and the loop ends at its goal."""
    monkeypatch.chdir(tmp_path)
    snippets = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert len(snippets) >= 2
    names: dict[str, object] = {}
    for snippet in snippets:
        exec(compile(snippet, "README.md", "exec"), names)
    position, _ = names["command"]  # type: ignore[misc]
    assert position == pytest.approx([1.2, 0.1], abs=2e-3)
    assert (tmp_path / "reach.safetensors").exists()


def test_commands_and_links_exist() -> None:
    """Every make target, file and figure in the README exists."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = re.findall(r"^make (\w+)", README, re.MULTILINE)
    assert targets[:2] == ["demo", "test"]
    for target in targets:
        assert re.search(rf"^{target}:", makefile, re.MULTILINE)
    for link in re.findall(r'\]\(([\w/.]+)\)|src="([^"]+)"', README):
        assert (ROOT / "".join(link)).exists()
