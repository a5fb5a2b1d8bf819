"""Figures of recordings, models and evaluations; they need the extra `plot`.

Every function draws on its argument `figure`, such as `matplotlib.pyplot.figure()`, or on a new
figure, and returns it. `save` writes it: `plot.save(plot.styles(model), "styles.png")`.
"""

from pdmp.plot.canvas import save
from pdmp.plot.movements import demonstrations, fan
from pdmp.plot.noise import cut_off
from pdmp.plot.prediction import held_out, prediction_error
from pdmp.plot.rhythm import phase_portrait
from pdmp.plot.space import singular_values, styles

__all__ = [
    "cut_off",
    "demonstrations",
    "fan",
    "held_out",
    "phase_portrait",
    "prediction_error",
    "save",
    "singular_values",
    "styles",
]
