"""Forward kinematics as a table that the page evaluates exactly.

Points of a chain of revolute joints are sums of products of 1, cos qᵢ and sin qᵢ, one factor for
each joint before the point; for a prismatic joint the factors are 1 and qᵢ, for a rotation the ten
products of two components of its unit quaternion, of which the rotation matrix consists. With three
values of each angle, two of each length, and ten rotations, the coefficients are those of an
interpolation without error.
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
"""Degrees of freedom of a point, three for a rotation: 3⁸ = 6561 positions to evaluate."""
MAX_POINTS = 64
MAX_ERROR = 1e-7
"""Largest error of the interpolation, relative to the extent of the points."""
N_TESTS = 24
ROTATION = "rotation"
"""In place of a turn: the four columns from this one on are a unit quaternion, in any order."""
PAIRS = [(i, j) for i in range(4) for j in range(i, 4)]
ROTATIONS = [
    np.bincount([i, j], minlength=4) / np.linalg.norm(np.bincount([i, j], minlength=4))
    for i, j in PAIRS
]
"""Unit quaternions at which the products of all pairs of components are independent."""


def stick_figure(
    model: Model,
    kinematics: Callable[[Array], ArrayLike],
    links: Sequence[tuple[int, int]] | None,
) -> dict[str, Any]:
    """Returns the coefficients of each point, and the links between points."""
    check_function("kinematics", kinematics)
    tests = _tests(model)
    first = _points(kinematics, tests[0], None)
    scale = max(float(np.ptp(first, axis=0).max()), float(abs(first).max()), 1e-300)
    inside = {column + k for column in model.rotations for k in (1, 2, 3)}
    turns: dict[int, float | str | None] = {
        d: ROTATION
        if d in model.rotations
        else _turn(kinematics, model.coordinate_units[d], tests, d, scale)
        for d in range(model.n_coordinates)
        if d not in inside
    }
    found = [_points(kinematics, q, first.shape) for q in tests]
    points = []
    for p in range(len(first)):
        joints = _joints(kinematics, turns, tests, p, scale)
        n_dofs = sum(3 if turns[d] == ROTATION else 1 for d in joints)
        if n_dofs > MAX_JOINTS:
            raise value_error(
                f"kinematics: point {p} depends on {n_dofs} degrees of freedom, more than "
                f"{MAX_JOINTS}: omit points that depend on more"
            )
        points.append({"dofs": joints, "turns": [turns[d] for d in joints]})
    _interpolate(kinematics, points, tests[0])
    for q, expected in zip(tests, found, strict=True):
        for p, point in enumerate(points):
            error = abs(evaluate(point, q) - expected[p]).max()
            if not error <= MAX_ERROR * scale:
                names = map(join_label, model.coordinate_names, model.coordinate_units)
                raise value_error(
                    f"kinematics: point {p} is no sum of products of 1, cos q and sin q, or 1 and "
                    f"q, of the degrees of freedom ({', '.join(names)}): it differs by {error:.3g} "
                    "from such a sum; state the unit of each, pass points of a chain of "
                    "revolute or prismatic joints or of a rotated body, or omit kinematics"
                )
    return {"dimension": first.shape[1], "links": _links(links, len(first)), "points": points}


def evaluate(point: dict[str, Any], position: Array) -> Array:
    """Returns a point at a position (D,), as the page computes it."""
    values = point["coefficients"]
    for d, turn in zip(point["dofs"], point["turns"], strict=True):
        values = np.tensordot(_factors(position[_columns(d, turn)], turn), values, axes=1)
    return np.asarray(values)


def _columns(d: int, turn: float | str | None) -> slice:
    """Returns the coordinates of a joint or rotation."""
    return slice(d, d + (4 if turn == ROTATION else 1))


def _factors(value: Array, turn: float | str | None) -> Array:
    """Returns the factors of the coordinates of a joint or rotation."""
    if turn is None:
        return np.array([1.0, value[0]])
    if isinstance(turn, str):
        return np.array([value[i] * value[j] for i, j in PAIRS]) / (value @ value)
    angle = value[0] / turn * TURN
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
    """Returns positions in twice the range of the demonstrations, the same in every call.

    Rotations are any.
    """
    paths = [
        model.rollout(model.conditions(m), dt=model.durations[m] / 20).position
        for m in range(min(model.n_demos, 20))
    ]
    low, high = np.min([p.min(0) for p in paths], 0), np.max([p.max(0) for p in paths], 0)
    middle, half = (low + high) / 2, np.maximum(high - low, 1e-3 * abs(high) + 1e-9)
    # Fractions of multiples of √prime are spread evenly and differ between degrees of freedom.
    primes = [n for n in range(2, 2000) if all(n % k for k in range(2, int(n**0.5) + 1))]
    roots = np.sqrt(primes[: model.n_coordinates])
    found = []
    for k in range(1, N_TESTS + 1):
        share = 2 * ((k * roots) % 1) - 1
        position = middle + half * share
        for column in model.rotations:
            quaternion = share[column : column + 4]
            position[column : column + 4] = quaternion / np.linalg.norm(quaternion)
        found.append(position)
    return found


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
    kinematics: Callable[[Array], ArrayLike],
    turns: dict[int, float | str | None],
    tests: list[Array],
    p: int,
    scale: float,
) -> list[int]:
    """Returns the joints and rotations on which a point depends, by their first coordinate."""
    joints = []
    for d, turn in turns.items():
        for q, other in zip(tests[:4], tests[4:8], strict=True):
            moved, own = q.copy(), _columns(d, turn)
            moved[own] = other[own]
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
        nodes = [_nodes(base[d], turn) for d, turn in zip(joints, turns, strict=True)]
        values = []
        for combination in product(*nodes):
            position = base.copy()
            for d, turn, value in zip(joints, turns, combination, strict=True):
                position[_columns(d, turn)] = value
            key = tuple(position.tolist())
            if key not in computed:
                computed[key] = _points(kinematics, position, None)
            values.append(computed[key][p])
        tensor = np.array(values).reshape(*map(len, nodes), -1)
        for axis, (at, turn) in enumerate(zip(nodes, turns, strict=True)):
            inverse = np.linalg.inv([_factors(value, turn) for value in at])
            tensor = np.moveaxis(np.tensordot(inverse, tensor, axes=(1, axis)), 0, axis)
        point["coefficients"] = tensor


def _nodes(base: float, turn: float | str | None) -> list[Array]:
    """Returns values of a joint or rotation, one for each of its factors."""
    if turn is None:
        return [np.array([base + share * max(abs(base), 1.0)]) for share in (0.0, 1.0)]
    if isinstance(turn, str):
        return ROTATIONS
    return [np.array([k * turn / 3]) for k in range(3)]


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
