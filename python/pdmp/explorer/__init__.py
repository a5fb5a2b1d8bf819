"""A model to explore in a browser or a notebook: one HTML file without server or network."""

from __future__ import annotations

import html
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from os import PathLike
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING

from pdmp._files import atomic_write
from pdmp._messages import check_type, value_error
from pdmp._native import Demonstration, Limits, Model
from pdmp.explorer._payload import payload

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Explorer", "explorer"]

SCRIPTS = ("motion.js", "canvas.js", "panels.js", "controls.js", "strips.js", "main.js")
MAX_BYTES = 2_000_000
"""Largest page: one that mail and notebooks carry."""
HEIGHT = 760
"""Height of the page in a notebook, in pixels."""


@dataclass(frozen=True)
class Explorer:
    """Page with a model to explore, returned by `Model.explorer`; notebooks display it.

    Attributes
    ----------
    html : str
        The page.
    """

    html: str

    def save(self, path: str | PathLike[str]) -> None:
        """Writes the page, atomically.

        Raises
        ------
        OSError
            The file cannot be written, or its folder does not exist.
        """
        with atomic_write(path) as draft:
            Path(draft).write_text(self.html, encoding="utf-8", newline="\n")

    def _repr_html_(self) -> str:
        """Returns a frame with the page, which cannot reach the notebook."""
        return (
            f'<iframe srcdoc="{html.escape(self.html)}" title="Explorer of a movement primitive" '
            f'sandbox="allow-scripts allow-downloads" '
            f'style="width:100%;height:{HEIGHT}px;border:0"></iframe>'
        )

    def __repr__(self) -> str:
        """Returns the size of the page."""
        return f"<pdmp.explorer.Explorer: page of {len(self.html.encode()) // 1000} kB>"


def explorer(
    model: Model,
    path: str | PathLike[str] | None = None,
    *,
    demonstrations: Sequence[Demonstration] | Mapping[str, Demonstration] | None = None,
    limits: Limits | None = None,
    kinematics: Callable[[NDArray[np.float64]], ArrayLike] | None = None,
    links: Sequence[tuple[int, int]] | None = None,
    dofs: Sequence[str | int] | None = None,
    title: str | None = None,
) -> Explorer:
    """Makes a page with the model to explore; see `Model.explorer`."""
    if title is not None:
        check_type("title", title, str, "a text")
    data = payload(
        model,
        demonstrations=demonstrations,
        limits=limits,
        kinematics=kinematics,
        links=links,
        dofs=dofs,
    )
    folder = files(__package__)

    def source(name: str) -> str:
        return (folder / name).read_text(encoding="utf-8")

    # A tag in a name must not end the script in which the data are.
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    page = Template(source("page.html")).substitute(
        title=html.escape(title or f"{model.kind.capitalize()} movement primitive"),
        css=source("page.css"),
        data=text.replace("<", "\\u003c"),
        script="\n".join(map(source, SCRIPTS)),
    )
    size = len(page.encode())
    if size > MAX_BYTES:
        raise value_error(
            f"the page has {size / 1e6:.1f} MB, more than {MAX_BYTES / 1e6:g} MB: fit fewer styles "
            "or degrees of freedom, or omit demonstrations or kinematics"
        )
    made = Explorer(page)
    if path is not None:
        made.save(path)
    return made
