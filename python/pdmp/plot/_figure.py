"""Figure that a notebook shows."""

from __future__ import annotations

import io

from matplotlib.figure import Figure


class _NotebookFigure(Figure):
    """Figure that a notebook shows once, as the value of a cell.

    IPython shows a figure of matplotlib itself only after `matplotlib.pyplot` was imported, and one
    of `pyplot.figure()` twice if it is also the value of the cell.
    """

    def _repr_png_(self) -> bytes:
        image = io.BytesIO()
        self.savefig(image, format="png")
        return image.getvalue()
