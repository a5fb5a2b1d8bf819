"""Figures of recordings, models and evaluations; they need the extra `plot`.

Every function draws on its argument `figure`, or on a new figure, and returns it: a notebook shows
it as the value of a cell, and `save` writes it: `plot.save(plot.styles(model), "styles.png")`. For
a window, draw on `matplotlib.pyplot.figure(layout="constrained")` and call
`matplotlib.pyplot.show()`. A figure of `Figure.subfigures` takes its place beside others.
"""

from pdmp.plot.canvas import save
from pdmp.plot.motion import motion
from pdmp.plot.movements import demonstrations, fan
from pdmp.plot.noise import cut_off
from pdmp.plot.prediction import held_out, prediction_error
from pdmp.plot.rhythm import phase_portrait
from pdmp.plot.space import singular_values, styles
from pdmp.plot.variation import variation

__all__ = [
    "cut_off",
    "demonstrations",
    "fan",
    "held_out",
    "motion",
    "phase_portrait",
    "prediction_error",
    "save",
    "singular_values",
    "styles",
    "variation",
]
