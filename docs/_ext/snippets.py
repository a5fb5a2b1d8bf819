"""Execution of the Python snippets of the pages, with their output and figures in the page.

The fences ```` ```python ```` of a page are executed in order in one namespace, in an empty folder.
Text that a snippet prints, with its warnings, and the figure or page that it assigns to `figure` or
`explorer` follow the snippet. A snippet whose first line is `# Figure` is folded. Fences
```` ```py ```` are not run.
"""

import contextlib
import io
import os
import re
import shutil
import tempfile
import warnings
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform
from sphinx.util import logging

FOLDER = "_generated"
"""Folder of the figures in the source folder; not committed."""
EXPLORERS = "_explorers"
"""Folder of the explorers in the output."""
WIDTH = 96
"""Pixels of the page per inch of a figure."""

logger = logging.getLogger(__name__)


class Snippets(SphinxTransform):
    """Executes the snippets of a page, before images are collected."""

    default_priority = 350

    def apply(self, **_: Any) -> None:
        """Adds output and figure after each snippet of the page."""
        names: dict[str, Any] = {"__name__": "__main__"}
        snippets = [
            node
            for node in self.document.findall(nodes.literal_block)
            if node.get("language") == "python"
        ]
        if not snippets:
            return
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            for number, node in enumerate(snippets):
                try:
                    output = execute(node.astext(), names)
                except Exception as error:
                    text = f"snippet {number + 1}: {type(error).__name__}: {error}"
                    logger.warning(text, location=node)
                    return
                self._insert(node, number, output, names)

    def _insert(
        self, node: nodes.literal_block, number: int, output: str, names: dict[str, Any]
    ) -> None:
        """Inserts the results of a snippet after it, and folds it if it makes a figure alone."""
        figure, explorer = names.pop("figure", None), names.pop("explorer", None)
        page = self.env.docname.replace("/", "-")
        results: list[nodes.Node] = [printed(output)] if output else []
        if figure is not None:
            path = Path(self.env.srcdir, FOLDER, f"{page}-{number}.png")
            results.append(saved(figure, path, Path(self.env.srcdir)))
        if explorer is not None:
            path = Path(self.env.srcdir, FOLDER, f"{page}-{number}.html")
            path.parent.mkdir(exist_ok=True)
            explorer.save(path)
            results.append(explorer_frame(path, self.env.docname))
        if node.astext().startswith("# Figure"):
            fold = nodes.raw("", "<details><summary>Code of the figure</summary>", format="html")
            results = [*results, fold, node.deepcopy(), nodes.raw("", "</details>", format="html")]
        else:
            results.insert(0, node.deepcopy())
        node.replace_self(results)


def execute(code: str, names: dict[str, Any]) -> str:
    """Executes a snippet, and returns the text that it prints and the warnings that it issues."""
    output = io.StringIO()
    with warnings.catch_warnings(record=True) as issued, contextlib.redirect_stdout(output):
        warnings.simplefilter("always")
        exec(compile(code, "snippet", "exec"), names)
    for warning in issued:
        print(f"{warning.category.__name__}: {warning.message}", file=output)
    return output.getvalue()


def printed(text: str) -> nodes.literal_block:
    """Returns a block with the text that a snippet printed."""
    return nodes.literal_block(text, text.rstrip("\n"), language="text", classes=["output"])


def saved(figure: Any, path: Path, source: Path) -> nodes.image:
    """Writes a figure into the source folder, and returns an image with its labels as text."""
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path)
    width = round(WIDTH * figure.get_figwidth())
    close(figure)
    return figure_image(path, source, description(figure), width)


def figure_image(path: Path, source: Path, text: str, width: int) -> nodes.image:
    """Returns an image in the source folder."""
    uri = f"/{path.relative_to(source).as_posix()}"
    return nodes.image(uri=uri, alt=text, width=f"{width}px", classes=["result"])


def explorer_frame(path: Path, page: str) -> nodes.raw:
    """Returns a frame with an explorer, which `copy_explorers` copies into the output."""
    address = f"{'../' * page.count('/')}{EXPLORERS}/{path.name}"
    frame = f'<iframe class="explorer" src="{address}" title="Explorer" loading="lazy"></iframe>'
    link = f'<p><a href="{address}">Explorer in a page of its own</a></p>'
    return nodes.raw("", frame + link, format="html")


def copy_explorers(app: Sphinx, error: Exception | None) -> None:
    """Copies the explorers beside the pages."""
    if error is None and app.builder.format == "html":
        target = Path(app.outdir, EXPLORERS)
        target.mkdir(exist_ok=True)
        for path in Path(app.srcdir, FOLDER).glob("*.html"):
            shutil.copy(path, target)


def description(figure: Any) -> str:
    """Returns titles and labels of a figure as text for readers who do not see it."""
    panels = []
    for axes in figure.axes:
        labels = [axes.get_title(), axes.get_ylabel(), axes.get_xlabel()]
        panels.append(", ".join(re.sub(r"\s+", " ", label) for label in labels if label))
    return "Figure. " + "; ".join(dict.fromkeys(filter(None, panels)))


def close(figure: Any) -> None:
    """Releases a figure."""
    import matplotlib.pyplot as plt

    plt.close(figure)


def setup(app: Sphinx) -> dict[str, bool]:
    """Registers the transform."""
    os.environ["MATPLOTLIBRC"] = str(app.srcdir)
    app.add_transform(Snippets)
    app.connect("build-finished", copy_explorers)
    return {"parallel_read_safe": False}
