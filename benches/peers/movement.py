"""The movements that every contestant is given."""

from functools import cache

import numpy as np

import pdmp

N_DOFS = 7
N_STYLES = 3
DT = 0.001  # s
# As many functions for whoever imitates one movement as pdmp's network has by default.
N_BASIS = 50


def movement(style: float) -> np.ndarray:
    """Returns a reach of one second (1001, D) whose bends go with the style and with its square."""
    s = np.linspace(0, 1, 1001)[:, None]
    d = np.arange(N_DOFS)
    reach = s**3 * (10 - 15 * s + 6 * s**2) * (1 + d)
    once, twice = np.sin(np.pi * s) ** 2, np.sin(np.pi * s) * np.sin(2 * np.pi * s)
    return reach + style * once * np.cos(d) + style**2 * twice * np.sin(d)


def movements(count: int) -> list[np.ndarray]:
    """Returns movements whose styles divide [0, 1] evenly."""
    return [movement(style) for style in np.linspace(0, 1, count)]


@cache
def primitive() -> pdmp.Model:
    """Learns pdmp's primitive from ten movements, which J = 3 reproduces."""
    return pdmp.fit(movements(10), dt=DT, n_styles=N_STYLES)


def goals() -> list[np.ndarray]:
    """Returns two goals, to be given in turn."""
    return [movement(0)[-1], movement(0)[-1] + 0.1]
