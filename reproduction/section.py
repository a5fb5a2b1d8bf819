"""Section of the report on one figure of the paper."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SEED = 2011


@dataclass
class Section:
    """Title, paragraphs and tables in Markdown, and figures by file name."""

    title: str
    text: list[str]
    figures: dict[str, Figure] = field(default_factory=dict)
