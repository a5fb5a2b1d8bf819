"""Reader of joint limits in URDF, the Unified Robot Description Format."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree

from pdmp._labels import name_list
from pdmp._messages import quoted, value_error
from pdmp._native import Limits
from pdmp.robots._robot import Bound, Joint, check_range, chosen, combined

MAX_BYTES = 1 << 24
"""Largest file that is read, 16 MiB; descriptions of humanoids have some 0.1 MiB."""
MAX_DEPTH = 100
"""Deepest nesting of elements; URDF has 5, extensions of simulators some 10."""
BLOCK = 1 << 16  # bytes read at a time
RANGED = {"revolute", "prismatic"}
SINGLE = RANGED | {"continuous"}
"""Types of joints with one degree of freedom."""
OTHERS = {"fixed", "floating", "planar"}
KEYS = {
    "velocity": ("velocity",),
    "acceleration": ("acceleration", "deceleration"),
    "jerk": ("jerk",),
}
"""Attributes of a limit of magnitude, of which the smallest holds."""


def read(
    path: str | os.PathLike[str], joints: Sequence[str] | None, given: Mapping[str, Bound]
) -> Limits:
    """Reads the joint limits of a file, see `Limits.from_urdf`.

    Parameters
    ----------
    path : path
        File.
    joints : sequence of str or None
        Requested joints.
    given : mapping of str to float or array_like
        Further bounds of magnitude, by the name of their argument; None for none.
    """
    path = Path(path)
    if joints is not None:
        joints = name_list("joints", joints)
    found = _joints(path)
    movable = [name for name, joint in found.items() if joint.kind in SINGLE and not joint.leader]

    def why_not(name: str) -> str:
        if name not in found:
            return ""
        joint = found[name]
        if joint.leader:
            return f"joint {quoted(name)} mimics {quoted(joint.leader)}, whose limits hold"
        return f"joint {quoted(name)} is {joint.kind}"

    names = chosen(str(path), movable, joints, why_not)
    described = [found[name].limits(f"{path}, joint {quoted(name)}", given) for name in names]
    return combined(names, described, given)


class _Described:
    """A joint as it is written in the file."""

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.leader = ""
        """Joint that this one mimics; "" if it does not."""
        self.limit: dict[str, str] | None = None

    def limits(self, where: str, given: Mapping[str, Bound]) -> Joint:
        """Returns the limits as numbers; a bound in `given` replaces one of 0."""
        written = self.limit or {}
        lower, upper = -math.inf, math.inf
        if self.kind in RANGED:
            if not {"lower", "upper"} & set(written):
                raise value_error(
                    f"{where}: a {self.kind} joint without limits: add <limit lower=... upper=.../>"
                    + (", or make it continuous" if self.kind == "revolute" else "")
                )
            # A limit that is left out is 0 in the format.
            lower, upper = (_number(where, written, key, 0.0) for key in ("lower", "upper"))
            check_range(where, lower, upper)
        rates = {
            argument: min(
                _bound(where, written, key, given[argument] is not None) for key in KEYS[argument]
            )
            for argument in KEYS
        }
        return Joint(lower, upper, **rates)


def _number(where: str, written: dict[str, str], key: str, default: float) -> float:
    if key not in written:
        return default
    try:
        number = float(written[key])
    except ValueError:
        number = math.nan
    if math.isnan(number):
        xacro = "${" in written[key]
        fix = "expand the file with xacro first" if xacro else "correct it"
        raise value_error(f"{where}: {key} = {quoted(written[key])} is not a number: {fix}")
    return number


def _bound(where: str, written: dict[str, str], key: str, given: bool) -> float:
    """Returns a limit of magnitude, infinite without one or where an argument replaces a 0."""
    number = _number(where, written, key, math.inf)
    if number > 0:
        return number
    if number == 0 and given:
        return math.inf
    argument = "acceleration" if key == "deceleration" else key
    raise value_error(
        f"{where}: {key} = {written[key]}: "
        + (f"pass {argument}=, as exporters write 0 for unknown" if number == 0 else "correct it")
    )


class _Reader:
    """Target of the parser; keeps the joints alone, so that memory is bounded by them."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.joints: dict[str, _Described] = {}
        self._depth = 0
        self._joint: _Described | None = None

    def doctype(self, *_: object) -> NoReturn:
        """Rejects declarations of entities, which can grow without bound; URDF has none."""
        raise value_error(
            f"{self.path}: has a document type declaration, which URDF does not use: remove it"
        )

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Receives the start of an element."""
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise value_error(
                f"{self.path}: elements are nested more than {MAX_DEPTH} deep: not a robot"
            )
        if "/xacro}" in tag or "/wiki/xacro" in tag:
            raise value_error(
                f"{self.path}: a xacro file: expand it first, xacro robot.urdf.xacro > robot.urdf"
            )
        if self._depth == 1 and tag != "robot":
            fix = ": use Limits.from_mujoco" if tag == "mujoco" else ""
            raise value_error(f"{self.path}: not URDF: starts with <{tag}> instead of <robot>{fix}")
        # Transmissions and extensions of simulators have elements of the same name, further down.
        if self._depth == 2 and tag == "joint":
            self._start_joint(attributes)
        elif self._depth == 3 and self._joint is not None:
            if tag == "limit":
                self._joint.limit = attributes
            elif tag == "mimic":
                self._joint.leader = attributes.get("joint", "another joint")

    def _start_joint(self, attributes: dict[str, str]) -> None:
        name, kind = attributes.get("name", ""), attributes.get("type", "")
        number = len(self.joints) + 1
        if not name:
            raise value_error(f"{self.path}: joint {number} has no name: add one")
        if name in self.joints:
            raise value_error(f"{self.path}: two joints have the name {quoted(name)}: rename one")
        if kind not in SINGLE | OTHERS:
            expected = ", ".join(sorted(SINGLE | OTHERS))
            raise value_error(
                f"{self.path}, joint {quoted(name)}: type = {quoted(kind)}: expected one of "
                f"{expected}"
            )
        self.joints[name] = self._joint = _Described(kind)

    def end(self, _: str) -> None:
        """Receives the end of an element."""
        if self._depth == 2:
            self._joint = None
        self._depth -= 1

    def close(self) -> None:
        """Receives the end of the file."""


def _joints(path: Path) -> dict[str, _Described]:
    """Returns the joints of a file by name, in its order."""
    reader = _Reader(path)
    parser = ElementTree.XMLParser(target=reader)
    size = 0
    try:
        with path.open("rb") as file:
            while block := file.read(BLOCK):
                size += len(block)
                if size > MAX_BYTES:
                    raise value_error(
                        f"{path}: has more than {MAX_BYTES} bytes, too many for a robot: remove "
                        "meshes and other data that are not URDF"
                    )
                parser.feed(block)
        parser.close()
    except (ElementTree.ParseError, LookupError) as error:
        raise value_error(f"{path}: not URDF, or damaged: {error}") from None
    return reader.joints
