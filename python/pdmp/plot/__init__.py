"""Figures of recordings, and of a model and what it learnt from; they need the extra `plot`.

Every function draws on the `figure` it is given, such as `matplotlib.pyplot.figure()`, or makes one
of its own, and returns it; `save` writes it: `plot.save(plot.spectrum(model), "spectrum.png")`.
"""

from pdmp.plot._canvas import save
from pdmp.plot.foresight import held_out, prediction_error
from pdmp.plot.movements import demonstrations, fan
from pdmp.plot.noise import cut_off
from pdmp.plot.rhythm import phase_portrait
from pdmp.plot.space import spectrum, styles

__all__ = [
    "cut_off",
    "demonstrations",
    "fan",
    "held_out",
    "phase_portrait",
    "prediction_error",
    "save",
    "spectrum",
    "styles",
]
