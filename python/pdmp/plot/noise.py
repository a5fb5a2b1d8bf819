"""Residual analysis, which selects the cut-off of a low-pass filter."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pdmp._labels import join_label
from pdmp._native import Demonstration, residuals
from pdmp.plot.canvas import GREY, figure_of, grid_panels, legend, line_color

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

N_FREQUENCIES = 200
# Shares of half the sampling rate: the largest cut-off drawn, and the range of cut-offs at which
# the residual is noise alone.
MAX_FREQUENCY = 0.9
NOISE_RANGE = (0.3, 0.7)
# Height of a panel in levels of noise; residuals of the movement are much larger.
MAX_RESIDUAL = 5.0


def cut_off(demo: Demonstration, *, ax: Axes | ArrayLike | None = None) -> Figure:
    """Draws the residuals of `pdmp.preprocessing.lowpass` over its cut-off (residual analysis).

    Each panel has the root mean square R of the residual of one degree of freedom. The residual of
    white noise alone falls along a straight line; that line, fitted at high cut-offs and
    extrapolated to 0 Hz, gives the level of noise in the recording. The dot, with its frequency in
    the title, is the cut-off at which the residual equals that level: higher cut-offs leave more
    noise, lower ones remove more of the movement.

    Parameters
    ----------
    demo : Demonstration
        A recording with `dt` or `time`.
    ax : matplotlib.axes.Axes or array of Axes, optional
        The panels, or one in whose place they are drawn; by default those of a new figure.

    Raises
    ------
    ValueError
        A recording without times.
    ImportError
        matplotlib is not installed.

    References
    ----------
    D. A. Winter, Biomechanics and Motor Control of Human Movement, Wiley 2009, section 3.4.4
    """
    if demo.time is None:
        raise ValueError("demo has no times of its samples: create it with dt= or time=")
    half_rate = 0.5 * (demo.n_samples - 1) / (demo.time[-1] - demo.time[0])
    lowest = half_rate / demo.n_samples
    frequencies = np.geomspace(lowest, MAX_FREQUENCY * half_rate, N_FREQUENCIES)
    rms = residuals(demo, frequencies)
    names = demo.names or [f"y{d}" for d in range(demo.n_coordinates)]
    labels = [join_label("RMS", unit) for unit in demo.units or [""] * demo.n_coordinates]
    panels = grid_panels(labels, "cut-off [Hz]", ax)
    noise_only = (frequencies > NOISE_RANGE[0] * half_rate) & (
        frequencies < NOISE_RANGE[1] * half_rate
    )
    for axes, name, residual in zip(panels, names, rms.T, strict=True):
        axes.plot(frequencies, residual, color=line_color(0), label="residual")
        axes.set_title(name)
        slope, noise = np.polyfit(frequencies[noise_only], residual[noise_only], 1)
        if noise <= 0:  # a constant has no residual
            continue
        selected = np.interp(-noise, -residual, frequencies)
        line = noise + slope * frequencies
        axes.plot(frequencies, line, "--", color=line_color(1), label="noise alone")
        axes.axhline(noise, color=GREY, linewidth=0.8, label="level of noise")
        axes.plot(selected, noise, "o", color=line_color(1), label="cut-off")
        axes.set_title(f"{name}: {selected:.2g} Hz")
        axes.set_ylim(0, MAX_RESIDUAL * noise)
    legend(panels[0])
    return figure_of(panels)
