"""Directive `example`: an example script with its figure and the text that it prints."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from docutils import nodes
from snippets import FOLDER, image, printed
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

ROOT = Path(__file__).resolve().parents[2]
MAX_SECONDS = 120
WIDTH = 640
"""Width of a figure in pixels."""


class Example(SphinxDirective):
    """Runs `examples/NAME.py` in an empty folder, and shows its figure, output and code."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Returns the figure, the printed text and the code of the example."""
        name = self.arguments[0]
        script = ROOT / "examples" / f"{name}.py"
        self.env.note_dependency(str(script))
        source = Path(self.env.srcdir)
        path = source / FOLDER / f"{name}.png"
        path.parent.mkdir(exist_ok=True)
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run(
                [sys.executable, "-W", "error", str(script)],
                cwd=folder,
                capture_output=True,
                text=True,
                timeout=MAX_SECONDS,
                env=os.environ | {"MATPLOTLIBRC": str(source)},
            )
            figure = Path(folder, path.name)
            if done.returncode or not figure.exists():
                raise self.error(done.stderr or f"{script.name} saves no figure {path.name}")
            figure.replace(path)
        text = f"Figure of the example {name}, described above"
        code = script.read_text(encoding="utf-8")
        return [
            image(path, source, text, WIDTH),
            printed(done.stdout),
            nodes.literal_block(code, code, language="py"),
        ]


def setup(app: Sphinx) -> dict[str, bool]:
    """Registers the directive."""
    app.add_directive("example", Example)
    return {"parallel_read_safe": True}
