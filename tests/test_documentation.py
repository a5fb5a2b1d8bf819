"""The pages of the documentation are correct."""

import importlib
import re
from pathlib import Path

import pytest

import pdmp

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted(page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md"))
# Their snippets issue the warnings that they explain.
WARNING = {"troubleshooting.md", "howto/styles-and-smoothing.md", "concepts/contexts.md"}
FENCE = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)
MODULES = ("io", "preprocessing", "evaluation", "plot", "datasets", "robots", "autodiff")


def text(page: str) -> str:
    """Returns the text of a page."""
    return (DOCS / page).read_text(encoding="utf-8")


EXECUTED = [page for page in PAGES if FENCE.search(text(page))]


def test_most_pages_have_snippets() -> None:
    """The next test is not vacuous: start, concepts, how-to and troubleshooting have snippets."""
    assert {"start.md", "troubleshooting.md"} <= set(EXECUTED)
    assert sum(page.startswith("concepts/") for page in EXECUTED) >= 5
    assert sum(page.startswith("howto/") for page in EXECUTED) >= 5


@pytest.mark.parametrize("page", EXECUTED)
@pytest.mark.filterwarnings("ignore:FigureCanvasAgg")
def test_snippets_run(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, recwarn: pytest.WarningsRecorder
) -> None:
    """The snippets of a page run in order in an empty folder, and their assertions hold."""
    plt = pytest.importorskip("matplotlib.pyplot")
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "__main__"}
    for number, snippet in enumerate(FENCE.findall(text(page))):
        exec(compile(snippet, f"{page}, snippet {number + 1}", "exec"), names)
    plt.close("all")
    issued = [str(warning.message) for warning in recwarn if warning.category is UserWarning]
    assert bool(issued) == (page in WARNING), issued


def test_the_reference_has_every_public_name() -> None:
    """Every name of the package and of its modules is in the reference."""
    reference = "\n".join(text(page) for page in PAGES if page.startswith("api/"))
    automatic = set(re.findall(r"auto\w+:: pdmp\.([\w.]+)", reference))
    for name in set(pdmp.__all__) - {"__version__", *MODULES, *automatic}:
        raise AssertionError(f"pdmp.{name} is missing in docs/api")
    assert automatic >= set(MODULES)
    for module in MODULES:
        assert importlib.import_module(f"pdmp.{module}").__all__


def test_every_example_has_a_page() -> None:
    """Every example in Python has a page in the gallery that shows it."""
    for example in (ROOT / "examples").glob("*.py"):
        assert f"```{{example}} {example.stem}\n" in text(f"gallery/{example.stem}.md")


def test_every_page_is_reached() -> None:
    """Every page is in a table of contents."""
    contents = re.findall(r"```\{toctree\}\n(.*?)```", "\n".join(map(text, PAGES)), re.DOTALL)
    entries = {
        line.split("/")[-1].split("<")[-1].rstrip(">") for line in "\n".join(contents).split()
    }
    for page in set(PAGES) - {"index.md"}:
        stem = page.removesuffix(".md")
        assert stem.split("/")[-1] in entries, page
