"""Reproduction of the figures of the paper, and their files."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import TypeAlias

from pdmp.plot.canvas import new_figure
from reproduction.section import SEED, Section

Folder: TypeAlias = str | PathLike[str]
FIGURES = ("fig2", "fig3", "fig4", "fig5", "comparison")


def reproduce(
    figure: str,
    folder: Folder,
    recordings: Folder | None = None,
    seed: int = SEED,
    progress: Callable[[str], object] | None = None,
) -> str:
    """Reproduces one or all figures of Matsubara, Hyon and Morimoto (2011), and their numbers.

    Parameters
    ----------
    figure : {"fig2", "fig3", "fig4", "fig5", "comparison", "all"}
        Figure; the comparison is with the methods that the paper discusses.
    folder : path
        Folder for figures and tables: `fig3.md` for "fig3".
    recordings : path, optional
        Folder of CSV files, each of one walking person, with a column `t` [s] and columns
        `r_sh1, r_sh2, r_sh3, r_elb, l_sh1, …` [rad]; "fig5" then uses them too.
    seed : int
        Seed of the noise in the demonstrations.
    progress : callable, optional
        Called with the name of each figure before it is reproduced.

    Returns
    -------
    str
        The tables, in Markdown.

    Raises
    ------
    ValueError
        An unknown figure; a negative seed; recordings in which too few arms swing.
    ImportError
        The dependency group `reproduction` or the model of the robot is not installed.
    OSError
        A file that cannot be read or written.
    """
    if figure != "all" and figure not in FIGURES:
        raise ValueError(f'figure = "{figure}": must be one of {", ".join(FIGURES)}, all')
    if seed < 0:
        raise ValueError(f"seed = {seed}: must not be negative")
    if recordings is not None and figure not in ("fig5", "all"):
        raise ValueError(f'recordings: only "fig5" learns from them, not "{figure}"')
    if recordings is not None and not Path(recordings).is_dir():
        raise ValueError(f"recordings: {recordings} is not a folder")
    new_figure(1, 1)  # raises an error at once without matplotlib
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    reports = []
    for name in FIGURES if figure == "all" else [figure]:
        if progress is not None:
            progress(name)
        reports.append(_make(name, seed, recordings).write(folder, name))
    return "\n\n".join(reports)


def _make(figure: str, seed: int, recordings: Folder | None) -> Section:
    """Reproduces one of `FIGURES`; only its module is imported."""
    match figure:
        case "fig2":
            from reproduction.one_dof import figure_2

            return figure_2(seed)
        case "fig3":
            from reproduction.styles import figure_3

            return figure_3(seed)
        case "fig4":
            from reproduction.heights import figure_4

            return figure_4(seed)
        case "fig5":
            from reproduction.walking import figure_5

            return figure_5(recordings, seed)
        case _:
            from reproduction.rivals import comparison

            return comparison(seed)
