"""Movements for all libraries."""

from functools import cache

import numpy as np

import pdmp

N_DOFS = 7
N_STYLES = 3
DT = 0.001  # s
# Number of basis functions of the other libraries, the default of pdmp's network.
N_BASIS = 50


def movement(style: float) -> np.ndarray:
    """Returns a reach of one second (1001, D) with bends linear and quadratic in the style."""
    s = np.linspace(0, 1, 1001)[:, None]
    d = np.arange(N_DOFS)
    reach = s**3 * (10 - 15 * s + 6 * s**2) * (1 + d)
    once, twice = np.sin(np.pi * s) ** 2, np.sin(np.pi * s) * np.sin(2 * np.pi * s)
    return reach + style * once * np.cos(d) + style**2 * twice * np.sin(d)


def movements(count: int) -> list[np.ndarray]:
    """Returns movements whose styles are evenly spaced in [0, 1]."""
    return [movement(style) for style in np.linspace(0, 1, count)]


@cache
def primitive() -> pdmp.Model:
    """Fits a primitive of pdmp to ten movements, which J = 3 reproduces."""
    return pdmp.fit(movements(10), dt=DT, n_styles=N_STYLES)


def goals() -> list[np.ndarray]:
    """Returns two goals, to alternate between."""
    return [movement(0)[-1], movement(0)[-1] + 0.1]
