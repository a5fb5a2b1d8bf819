"""Removal of jumps by full turns from angles."""

import numpy as np

from pdmp._labels import FULL_TURN
from pdmp._messages import check_type
from pdmp._native import Demonstration


def unwrap(demo: Demonstration) -> Demonstration:
    """Removes jumps by full turns from the angles of a recording.

    After a jump by more than half a turn between two samples, the full turns that minimise the jump
    are added to all later samples. The goal moves by the turns of the last sample.

    Parameters
    ----------
    demo : Demonstration
        A recording. Degrees of freedom with unit "rad", "deg" or "°" are angles; without units,
        all are angles in rad.

    Returns
    -------
    Demonstration
        Unwrapped recording at the same times, with its names, units and context.
    """
    check_type("demo", demo, Demonstration, "pdmp.Demonstration")
    (position,), rest = demo.__getnewargs_ex__()
    units = demo.units or ["rad"] * demo.n_coordinates
    unwrapped = position.copy()
    for d, unit in enumerate(units):
        if unit in FULL_TURN:
            unwrapped[:, d] = np.unwrap(position[:, d], period=FULL_TURN[unit])
    if demo.goal is not None:
        rest["goal"] = demo.goal + unwrapped[-1] - position[-1]
    return Demonstration(unwrapped, **rest)
