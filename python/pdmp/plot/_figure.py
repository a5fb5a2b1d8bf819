"""Figure that a notebook shows."""

from __future__ import annotations

import io
from typing import Any

from matplotlib.figure import Figure


class _NotebookFigure(Figure):
    """Figure that a notebook shows once, as the value of a cell.

    IPython shows a figure of matplotlib itself only after `matplotlib.pyplot` was imported, and one
    of `pyplot.figure()` twice if it is also the value of the cell.
    """

    def savefig(self, *args: Any, **options: Any) -> None:
        """Writes the figure, with a layout for the limits that equal axes have once it is drawn."""
        self.draw_without_rendering()
        super().savefig(*args, **options)

    def _repr_png_(self) -> bytes:
        image = io.BytesIO()
        self.savefig(image, format="png")
        return image.getvalue()
