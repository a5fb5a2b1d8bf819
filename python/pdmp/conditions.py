"""Conditions of a movement, as keyword arguments of rollouts and controllers."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pdmp._messages import value_error
from pdmp._native import Model


def as_demonstrated(model: Model, demos: int | Sequence[int]) -> dict[str, Any]:
    """Returns the arguments that repeat one demonstration, or the mean of several.

    Parameters
    ----------
    model : Model
        The primitive.
    demos : int or sequence of int
        Indices of demonstrations, from 0 to M - 1.

    Returns
    -------
    dict
        `style` (J,); `tau` [s] or, where time was not scaled linearly, `timing` (K,) [s]; `goal`
        and `start` (D,) of a discrete or `anchor` (D,) of a rhythmic primitive: for `Model.rollout`
        and `Model.controller`.

    Raises
    ------
    ValueError
        No index, one that is no whole number, or one outside the demonstrations.

    Examples
    --------
    >>> trajectory = model.rollout(**pdmp.as_demonstrated(model, 3))
    """
    rows = np.atleast_1d(np.asarray(demos))
    if rows.size == 0:
        raise ValueError("demos is empty: pass at least one index")
    if rows.dtype.kind not in "iu" or rows.ndim > 1:
        raise value_error(
            f"demos = {demos!r}: pass the index of a demonstration, or a list of them"
        )
    for row in rows:
        if not 0 <= row < model.n_demos:
            raise value_error(f"demos: {row} must lie between 0 and {model.n_demos - 1}")
    arguments = {"style": model.styles[rows].mean(axis=0)}
    timing = model.timings[rows].mean(axis=0)
    if len(timing) > 1:
        arguments["timing"] = timing
    else:
        arguments["tau"] = float(model.tau * timing[0] / model.durations[model.nominal])
    if model.kind == "discrete":
        arguments["goal"] = model.goals[rows].mean(axis=0)
        arguments["start"] = model.starts[rows].mean(axis=0)
    else:
        arguments["anchor"] = model.anchors[rows].mean(axis=0)
    return arguments


def blend(a: Mapping[str, ArrayLike], b: Mapping[str, ArrayLike], share: float) -> dict[str, Any]:
    """Returns the arguments (1 - share) a + share b, name by name.

    Parameters
    ----------
    a, b : mapping of str to array_like
        Arguments with the same names, such as two of `as_demonstrated`, or `{"style": s}`.
    share : float
        0 gives `a`, 1 gives `b`; values outside [0, 1] extrapolate.

    Raises
    ------
    ValueError
        Names that only one of the two has, values that are no numbers or differ in shape, or a
        share that is not finite.
    """
    if not np.isfinite(share):
        raise value_error(f"share = {share}: must be finite")
    if single := sorted(a.keys() ^ b.keys()):
        raise value_error(f"{', '.join(single)}: given for one of the two only; give it for both")
    blended = {}
    for name in a:
        ends = np.asarray(a[name]), np.asarray(b[name])
        if any(end.dtype.kind not in "iuf" for end in ends) or ends[0].shape != ends[1].shape:
            raise value_error(
                f"{name}: {a[name]!r} and {b[name]!r} cannot be blended: expected numbers, as many "
                "in both"
            )
        blended[name] = (1 - share) * ends[0] + share * ends[1]
    return blended
