"""Joint limits of a robot, as published or as in its description."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from pdmp._labels import name_list
from pdmp._messages import quoted, value_error
from pdmp._native import Limits

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

Bound: TypeAlias = "ArrayLike | None"
"""One number for all joints, one for each, or none."""
MAX_LISTED = 12  # joints in a message


@dataclass(frozen=True)
class Joint:
    """Limits of one joint.

    Attributes
    ----------
    lower, upper : float
        Limits of the position; infinite without any.
    velocity, acceleration, jerk : float
        Limits of the magnitude, per s, s² and s³; infinite without any.
    """

    lower: float = -math.inf
    upper: float = math.inf
    velocity: float = math.inf
    acceleration: float = math.inf
    jerk: float = math.inf


def chosen(
    place: str, names: Sequence[str], joints: Sequence[str] | None, why_not: Callable[[str], str]
) -> list[str]:
    """Returns the requested joints, or all that can be moved.

    Parameters
    ----------
    place : str
        File or model, for error texts.
    names : sequence of str
        Joints that can be moved, in the order of the file.
    joints : sequence of str or None
        Requested joints.
    why_not : callable
        Returns why a joint that is not among `names` is not one that can be moved; "" if the
        description does not have it.

    Raises
    ------
    ValueError
        A joint that is missing, cannot be moved or is requested twice, or no joint at all.
    """
    if joints is None:
        if not names:
            raise value_error(f"{place}: has no joint that can be moved")
        return list(names)
    requested = name_list("joints", joints)
    if not requested:
        raise value_error("joints is empty: pass None for all joints, or their names")
    for k, name in enumerate(requested):
        if name in requested[:k]:
            raise value_error(f"joints has {quoted(name)} twice: name each joint once")
        if name not in names:
            reason = why_not(name) or f"no joint {quoted(name)}"
            raise value_error(f"{place}: {reason}; joints to choose from: {listing(names)}")
    return requested


def listing(names: Sequence[str]) -> str:
    """Returns joint names for a message, the first ones of many."""
    more = len(names) - MAX_LISTED
    return ", ".join(names[:MAX_LISTED]) + (f" and {more} more" if more > 0 else "") or "none"


def bounds(argument: str, bound: Bound, joints: Sequence[str]) -> NDArray[np.float64]:
    """Returns a limit of magnitude for each joint (D,), infinite without one.

    Raises
    ------
    ValueError
        A bound that is not positive, or neither one number nor one for each joint.
    """
    if bound is None:
        return np.full(len(joints), math.inf)
    expected = f"expected one number or {len(joints)}, one for each joint ({listing(joints)})"
    try:
        values = np.asarray(bound, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise value_error(f"{argument} = {quoted(bound)}: {expected}") from None
    if values.shape not in {(), (len(joints),)}:
        raise value_error(f"{argument} has shape {list(values.shape)}: {expected}")
    values = np.array(np.broadcast_to(values, len(joints)))
    for name, value in zip(joints, values.tolist(), strict=True):
        if not value > 0:
            raise value_error(
                f"{argument} = {value} for {quoted(name)}: expected a positive number; infinity is "
                "no limit"
            )
    return values


def combined(
    joints: Sequence[str], described: Sequence[Joint], given: Mapping[str, Bound]
) -> Limits:
    """Returns the limits of joints, in each the smaller of a described and a given bound."""
    lower, upper = (np.array([getattr(each, k) for each in described]) for k in ("lower", "upper"))
    magnitudes = {
        name: np.minimum([getattr(each, name) for each in described], bounds(name, bound, joints))
        for name, bound in given.items()
    }
    finite = {name: limit for name, limit in magnitudes.items() if np.isfinite(limit).any()}
    return Limits(
        position=(lower, upper) if np.isfinite([lower, upper]).any() else None,
        velocity=finite.get("velocity"),
        acceleration=finite.get("acceleration"),
        jerk=finite.get("jerk"),
    )


def check_range(where: str, lower: float, upper: float) -> None:
    """Raises ValueError for an empty or undefined range of positions."""
    if not lower < upper:
        raise value_error(
            f"{where}: lower = {lower} is not below upper = {upper}: correct the range, or leave "
            "the joint out through joints="
        )


@dataclass(frozen=True, kw_only=True)
class Robot:
    """Published joint limits of a robot, and their source.

    Attributes
    ----------
    name : str
        Name of the robot in `REGISTRY`.
    contents : str
        Maker, model and interface.
    joints : tuple of str
        Names of the joints (D,), in the order of the limits.
    units : tuple of str
        Units of the positions; velocities are per s, accelerations per s², jerks per s³.
    lower, upper : tuple of float
        Limits of the position (D,).
    velocity, acceleration, jerk : tuple of float or None
        Limits of the magnitude (D,); None where the maker publishes none.
    source : str
        Document and table, with the version or commit.
    date : str
        Date that the source gives for its values, otherwise that of reading it.
    url : str
        Address of the source.
    note : str
        What the maker does not publish, and conditions of the values.
    """

    name: str
    contents: str
    joints: tuple[str, ...]
    units: tuple[str, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    velocity: tuple[float, ...] | None = None
    acceleration: tuple[float, ...] | None = None
    jerk: tuple[float, ...] | None = None
    source: str
    date: str
    url: str
    note: str

    def limits(
        self,
        joints: Sequence[str] | None = None,
        *,
        velocity: Bound = None,
        acceleration: Bound = None,
        jerk: Bound = None,
    ) -> Limits:
        """Returns the limits, for a controller or a planner.

        Parameters
        ----------
        joints : sequence of str, optional
            Joints in the order of the degrees of freedom; all by default.
        velocity, acceleration, jerk : float or array_like, (D,), optional
            Bounds per s, s² and s³, where the maker publishes none or where the task needs smaller
            ones: of two bounds of a joint the smaller holds.

        Raises
        ------
        ValueError
            An unknown joint, or a bound that is not positive or not of the number of joints.

        Examples
        --------
        >>> limits = pdmp.robots.REGISTRY["ur5e"].limits(acceleration=4.0)
        >>> limits.velocity[0], limits.acceleration[0]
        (np.float64(3.141592653589793), np.float64(4.0))
        """
        names = chosen(self.name, self.joints, joints, lambda _: "")
        given = {"velocity": velocity, "acceleration": acceleration, "jerk": jerk}
        columns = {key: getattr(self, key) for key in ("lower", "upper", *given)}
        described = [
            Joint(**{key: column[k] for key, column in columns.items() if column is not None})
            for k in map(self.joints.index, names)
        ]
        return combined(names, described, given)
