"""Removal of jumps by full turns from angles."""

import numpy as np

from pdmp._labels import FULL_TURN
from pdmp._native import Demonstration


def unwrap(demo: Demonstration) -> Demonstration:
    """Removes jumps by a full turn from the angles of a recording.

    Where an angle jumps by more than half a turn from one sample to the next, the full turns that
    bring it nearest are added from there on. A goal is moved by as many turns as the last sample.

    Parameters
    ----------
    demo : Demonstration
        A recording. Degrees of freedom whose unit is "rad", "deg" or "°" are angles; all are, in
        radians, where no units are known.

    Returns
    -------
    Demonstration
        At the same times, with its names, units and context.
    """
    (position,), rest = demo.__getnewargs_ex__()
    units = demo.units or ["rad"] * demo.n_dofs
    unwrapped = position.copy()
    for d, unit in enumerate(units):
        if unit in FULL_TURN:
            unwrapped[:, d] = np.unwrap(position[:, d], period=FULL_TURN[unit])
    if demo.goal is not None:
        rest["goal"] = demo.goal + unwrapped[-1] - position[-1]
    return Demonstration(unwrapped, **rest)
