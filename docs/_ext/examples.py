"""Directive `example`: an example script with its figure, its text and an explorer of its model."""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from docutils import nodes
from docutils.statemachine import StringList
from snippets import FOLDER, explorer_frame, figure_image, printed
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

ROOT = Path(__file__).resolve().parents[2]
RUNNER = Path(__file__).with_name("run_example.py")
MAX_SECONDS = 120
WIDTH = 640
"""Width of a figure in pixels."""


class Example(SphinxDirective):
    """Runs `examples/NAME.py` in an empty folder, and shows figure, explorer, output and code."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Returns the figure, the explorer, the printed text and the code of the example."""
        name = self.arguments[0]
        script = ROOT / "examples" / f"{name}.py"
        self.env.note_dependency(str(script))
        source = Path(self.env.srcdir)
        path = source / FOLDER / f"{name}.png"
        path.parent.mkdir(exist_ok=True)
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run(
                [sys.executable, "-W", "error", str(RUNNER), str(script)],
                cwd=folder,
                capture_output=True,
                text=True,
                timeout=MAX_SECONDS,
                env=os.environ | {"MATPLOTLIBRC": str(source)},
            )
            figure = Path(folder, path.name)
            if done.returncode or not figure.exists():
                raise self.error(done.stderr or f"{script.name} saves no figure {path.name}")
            shutil.copy(figure, path)
            explorer = Path(folder, f"{name}.html")
            frames = []
            if explorer.exists():
                page = path.with_suffix(".html")
                shutil.copy(explorer, page)
                frames.append(explorer_frame(page, self.env.docname))
        text = f"Figure of the example {name}, described above"
        code = script.read_text(encoding="utf-8")
        return [
            figure_image(path, source, text, WIDTH),
            *frames,
            printed(done.stdout),
            nodes.literal_block(code, code, language="py"),
        ]


class Thumbnails(SphinxDirective):
    """Table of the pages of this folder that have an example, with figure, title and text."""

    def run(self) -> list[nodes.Node]:
        """Returns the table; the pages and their figures come first, in the order of names."""
        source = Path(self.env.srcdir)
        folder = Path(self.env.docname).parent
        rows = []
        for page in sorted((source / folder).glob("[0-9]*.md")):
            self.env.note_dependency(str(page))
            title, text = page.read_text(encoding="utf-8").split("\n\n")[:2]
            title = title.removeprefix("# ")
            image = f"![{title}](/{FOLDER}/{page.stem}.png){{width=260px}}"
            rows.append(f"| {image} | **[{title}]({page.name})**<br>{' '.join(text.split())} |")
        lines = ["| | |", "|---|---|", *rows]
        table = nodes.container(classes=["thumbnails"])
        self.state.nested_parse(StringList(lines, source=self.env.docname), 0, table)
        for node in table.findall(nodes.image):
            node["classes"].append("result")
        return [table]


def setup(app: Sphinx) -> dict[str, bool]:
    """Registers the directives."""
    app.add_directive("example", Example)
    app.add_directive("thumbnails", Thumbnails)
    return {"parallel_read_safe": False}
