"""Figures of recordings, models and evaluations; they need the extra `plot`.

Every function draws into a new figure and returns it: a notebook shows it as the value of a cell,
and `save` writes it: `plot.save(plot.styles(model), "styles.png")`. With `ax=` it draws into Axes
of yours: one for each panel, row by row, or a single one in whose place the panels are made.
`matplotlib.pyplot.show()` shows them in a window, a notebook at the end of the cell::

    figure, (left, right) = plt.subplots(1, 2, layout="constrained")
    plot.styles(model, ax=left)
    plot.demonstrations(model, demos, ax=right);  # the semicolon hides the value

`rcParams` apply. Where these keep their default, colours are those of Okabe and Ito, which
colour-blind readers distinguish, and the resolution is 150 pixels per inch.
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
