"""The figure by which the cut-off of a low-pass filter is chosen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pdmp._native import Demonstration, residuals
from pdmp.plot._canvas import BLUE, GREY, ORANGE, grid_panels, legend

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SAMPLES = 200
# Shares of half the sampling rate: as far as the filter goes, and where noise alone is left.
HIGHEST = 0.9
NOISE = (0.3, 0.7)
# Height of a panel, in levels of noise: movement goes far beyond.
TOP = 5.0


def cut_off(demo: Demonstration, *, figure: Figure | None = None) -> Figure:
    """Draws the residuals of `pdmp.preprocessing.lowpass` over its cut-off (residual analysis).

    Each panel has the root mean square R of what is taken off one degree of freedom. Of white
    noise alone R would fall along a straight line; that line, fitted at high cut-offs and followed
    to 0 Hz, tells the noise there is in the recording. The dot is the cut-off at which as much is
    taken off: higher ones leave more noise, lower ones take more movement off. Its frequency is in
    the title.

    Parameters
    ----------
    demo : Demonstration
        A recording with `dt` or `time`.
    figure : matplotlib.figure.Figure, optional
        Where to draw.

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
        raise ValueError(
            "demo does not tell when its samples were taken: make it with dt= or time="
        )
    half_rate = 0.5 * (demo.n_samples - 1) / (demo.time[-1] - demo.time[0])
    lowest = half_rate / demo.n_samples
    frequencies = np.geomspace(lowest, HIGHEST * half_rate, SAMPLES)
    off = residuals(demo, frequencies)
    names = demo.names or [f"y{d}" for d in range(demo.n_dofs)]
    labels = [f"RMS [{unit}]" if unit else "RMS" for unit in demo.units or [""] * demo.n_dofs]
    figure, panels = grid_panels(labels, "cut-off [Hz]", figure)
    alone = (frequencies > NOISE[0] * half_rate) & (frequencies < NOISE[1] * half_rate)
    for axes, name, residual in zip(panels, names, off.T, strict=True):
        axes.plot(frequencies, residual, color=BLUE, label="taken off")
        axes.set_title(name)
        slope, noise = np.polyfit(frequencies[alone], residual[alone], 1)
        if noise <= 0:  # nothing is taken off what stands still
            continue
        chosen = np.interp(-noise, -residual, frequencies)
        line = noise + slope * frequencies
        axes.plot(frequencies, line, "--", color=ORANGE, label="noise alone")
        axes.axhline(noise, color=GREY, linewidth=0.8, label="noise there is")
        axes.plot(chosen, noise, "o", color=ORANGE, label="as much taken off")
        axes.set_title(f"{name}: {chosen:.2g} Hz")
        axes.set_ylim(0, TOP * noise)
    legend(figure, panels[0])
    return figure
