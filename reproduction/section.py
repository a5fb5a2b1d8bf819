"""Section of the report on one figure of the paper."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from pdmp import plot
from pdmp._files import atomic_write

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SEED = 2011


@dataclass
class Section:
    """Title, paragraphs and tables in Markdown, and figures by file name."""

    title: str
    text: list[str]
    figures: dict[str, Figure] = field(default_factory=dict)

    def write(self, folder: Path, name: str) -> str:
        """Writes the figures and `name`.md into a folder, and returns the text."""
        for file, figure in self.figures.items():
            plot.save(figure, folder / f"{file}.png")
        report = "\n\n".join([f"# {self.title}", *self.text])
        images = "\n\n".join(f"![{file}]({file}.png)" for file in self.figures)
        with atomic_write(folder / f"{name}.md") as draft:
            draft.write_text(f"{report}\n\n{images}\n", encoding="utf-8")
        return report
