"""Forward kinematics as a table that the page evaluates exactly.

Points of a chain of revolute joints are sums of products of 1, cos qᵢ and sin qᵢ, one factor for
each joint before the point; for a prismatic joint the factors are 1 and qᵢ. With three values of
each angle, or two of each length, the coefficients are those of an interpolation without error.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from math import tau as TURN
from typing import TYPE_CHECKING, Any

import numpy as np

from pdmp._labels import join_label
from pdmp._messages import check_function, quoted, value_error
from pdmp._native import Model, turn_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

MAX_JOINTS = 8
"""Degrees of freedom of a point: 3⁸ = 6561 positions to evaluate."""
MAX_POINTS = 64
MAX_ERROR = 1e-7
"""Largest error of the interpolation, relative to the extent of the points."""
N_TESTS = 24


def stick_figure(
    model: Model,
    kinematics: Callable[[Array], ArrayLike],
    links: Sequence[tuple[int, int]] | None,
) -> dict[str, Any]:
    """Returns the coefficients of each point, and the links between points."""
    check_function("kinematics", kinematics)
    if model.rotations:
        raise value_error(
            "kinematics do not apply to a model with rotations: a stick figure needs joint "
            "positions; omit kinematics"
        )
    tests = _tests(model)
    first = _points(kinematics, tests[0], None)
    scale = max(float(np.ptp(first, axis=0).max()), float(abs(first).max()), 1e-300)
    turns = [_turn(kinematics, model.units[d], tests, d, scale) for d in range(model.n_dofs)]
    found = [_points(kinematics, q, first.shape) for q in tests]
    points = []
    for p in range(len(first)):
        joints = _joints(kinematics, tests, p, scale)
        if len(joints) > MAX_JOINTS:
            raise value_error(
                f"kinematics: point {p} depends on {len(joints)} degrees of freedom, more than "
                f"{MAX_JOINTS}: omit points that depend on more"
            )
        points.append({"dofs": joints, "turns": [turns[d] for d in joints]})
    _interpolate(kinematics, points, tests[0])
    for q, expected in zip(tests, found, strict=True):
        for p, point in enumerate(points):
            error = abs(evaluate(point, q) - expected[p]).max()
            if not error <= MAX_ERROR * scale:
                names = map(join_label, model.names, model.units)
                raise value_error(
                    f"kinematics: point {p} is no sum of products of 1, cos q and sin q, or 1 and "
                    f"q, of the degrees of freedom ({', '.join(names)}): it differs by {error:.3g} "
                    "from such a sum; state the unit of each, pass points of a chain of "
                    "revolute or prismatic joints, or omit kinematics"
                )
    return {"dimension": first.shape[1], "links": _links(links, len(first)), "points": points}


def evaluate(point: dict[str, Any], position: Array) -> Array:
    """Returns a point at a position (D,), as the page computes it."""
    values = point["coefficients"]
    for d, turn in zip(point["dofs"], point["turns"], strict=True):
        values = np.tensordot(_factors(position[d], turn), values, axes=1)
    return np.asarray(values)


def _factors(value: float, turn: float | None) -> Array:
    if turn is None:
        return np.array([1.0, value])
    angle = value / turn * TURN
    return np.array([1.0, np.cos(angle), np.sin(angle)])


def _points(
    kinematics: Callable[[Array], ArrayLike], position: Array, shape: tuple[int, ...] | None
) -> Array:
    """Returns the points (P, 2) or (P, 3) at a position, checked."""
    points = np.array(kinematics(position.copy()), dtype=np.float64)
    right = points.ndim == 2 and points.shape[1] in (2, 3) and 0 < len(points) <= MAX_POINTS
    if not right or (shape is not None and points.shape != shape):
        expected = f"{list(shape)}" if shape else f"(P, 2) or (P, 3) with P at most {MAX_POINTS}"
        raise value_error(f"kinematics returns shape {list(points.shape)}, expected {expected}")
    if not np.isfinite(points).all():
        raise value_error(f"kinematics returns a point that is not finite at {quoted(position)}")
    return points


def _tests(model: Model) -> list[Array]:
    """Returns positions in twice the range of the demonstrations, the same in every call."""
    paths = [
        model.rollout(model.conditions(m), dt=model.durations[m] / 20).position
        for m in range(min(model.n_demos, 20))
    ]
    low, high = np.min([p.min(0) for p in paths], 0), np.max([p.max(0) for p in paths], 0)
    middle, half = (low + high) / 2, np.maximum(high - low, 1e-3 * abs(high) + 1e-9)
    # Fractions of multiples of √prime are spread evenly and differ between degrees of freedom.
    primes = [n for n in range(2, 2000) if all(n % k for k in range(2, int(n**0.5) + 1))]
    roots = np.sqrt(primes[: model.n_dofs])
    shares = [(k * roots) % 1 for k in range(1, N_TESTS + 1)]
    return [middle + half * (2 * share - 1) for share in shares]


def _turn(
    kinematics: Callable[[Array], ArrayLike], unit: str, tests: list[Array], d: int, scale: float
) -> float | None:
    """Returns one turn of an angle in its unit, or None for a length."""
    turn = turn_of(unit) if unit else None
    if turn is not None or unit:
        return turn
    # Without a unit, points on which a degree of freedom acts evenly make it a length.
    for q in tests[:3]:
        step = np.zeros_like(q)
        step[d] = 0.7
        below, at, above = (_points(kinematics, q + k * step, None) for k in (-1, 0, 1))
        if abs(below + above - 2 * at).max() > MAX_ERROR * scale:
            return TURN
    return None


def _joints(
    kinematics: Callable[[Array], ArrayLike], tests: list[Array], p: int, scale: float
) -> list[int]:
    """Returns the degrees of freedom on which a point depends."""
    n = len(tests[0])
    joints = []
    for d in range(n):
        for q, other in zip(tests[:4], tests[4:8], strict=True):
            moved = q.copy()
            moved[d] = other[d]
            change = _points(kinematics, moved, None)[p] - _points(kinematics, q, None)[p]
            if abs(change).max() > 1e-12 * scale:
                joints.append(d)
                break
    return joints


def _interpolate(
    kinematics: Callable[[Array], ArrayLike], points: list[dict[str, Any]], base: Array
) -> None:
    """Adds the coefficients of each point, (3 or 2, …, dimension)."""
    computed: dict[tuple[float, ...], Array] = {}
    for p, point in enumerate(points):
        joints, turns = point["dofs"], point["turns"]
        nodes = [
            base[d] + np.array([0.0, 1.0]) * max(abs(base[d]), 1.0)
            if turn is None
            else np.arange(3) * turn / 3
            for d, turn in zip(joints, turns, strict=True)
        ]
        values = []
        for combination in product(*nodes):
            position = base.copy()
            position[joints] = combination
            key = tuple(position.tolist())
            if key not in computed:
                computed[key] = _points(kinematics, position, None)
            values.append(computed[key][p])
        tensor = np.array(values).reshape(*map(len, nodes), -1)
        for axis, (at, turn) in enumerate(zip(nodes, turns, strict=True)):
            inverse = np.linalg.inv([_factors(value, turn) for value in at])
            tensor = np.moveaxis(np.tensordot(inverse, tensor, axes=(1, axis)), 0, axis)
        point["coefficients"] = tensor


def _links(links: Sequence[tuple[int, int]] | None, n: int) -> list[list[int]]:
    """Returns pairs of points to connect."""
    if links is None:
        return [[p, p + 1] for p in range(n - 1)]
    try:
        pairs = [[int(a), int(b)] for a, b in links]
    except (TypeError, ValueError):
        raise value_error(f"links = {quoted(links)}: expected pairs of points") from None
    for pair in pairs:
        if not all(0 <= p < n for p in pair):
            raise value_error(f"links has {pair}: expected points from 0 to {n - 1}")
    return pairs
