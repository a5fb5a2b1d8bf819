"""Joint limits of a MuJoCo model, and its joints."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pdmp._labels import name_list
from pdmp._messages import quoted, value_error
from pdmp._native import Limits
from pdmp.robots._robot import Bound, Joint, check_range, chosen, combined

if TYPE_CHECKING:
    from mujoco import MjModel


def read(
    model: str | os.PathLike[str] | MjModel,
    joints: Sequence[str] | None,
    given: Mapping[str, Bound],
) -> Limits:
    """Reads the joint limits of a model, see `Limits.from_mujoco`.

    Parameters
    ----------
    model : path or mujoco.MjModel
        File or compiled model.
    joints : sequence of str or None
        Requested joints.
    given : mapping of str to float or array_like
        Bounds of magnitude, by the name of their argument; None for none.
    """
    if joints is not None:
        joints = name_list("joints", joints)
    place, model = compiled(model)
    found = Joints.of(model)
    chosen_names = chosen(place, found.movable, joints, found.why_not)
    described = []
    for name in chosen_names:
        lower, upper = map(float, model.jnt_range[found.index[name]])
        limited = bool(model.jnt_limited[found.index[name]])
        # MuJoCo takes a range in the wrong order for none, unless the file limits the joint.
        if limited or lower > upper:
            check_range(f"{place}, joint {quoted(name)}", lower, upper)
        described.append(Joint(lower, upper) if limited else Joint())
    return combined(chosen_names, described, given)


def compiled(model: str | os.PathLike[str] | MjModel) -> tuple[str, Any]:
    """Returns the place of a model, for error texts, and the compiled model.

    Raises
    ------
    ImportError
        MuJoCo is not installed.
    ValueError
        A file that MuJoCo does not compile.
    """
    try:
        import mujoco
    except ImportError:
        raise ImportError("MuJoCo models need the package mujoco: pip install mujoco") from None
    place = "model"
    if isinstance(model, (str, os.PathLike)):
        place = str(Path(model))
        with open(place, "rb"):
            pass  # An absent file gets the error of the system.
        try:
            model = mujoco.MjModel.from_xml_path(place)
        except (ValueError, mujoco.FatalError) as error:
            raise value_error(f"{place}: not compiled by MuJoCo: {error}") from None
    if not isinstance(model, mujoco.MjModel):
        raise TypeError(f"model = {quoted(model)}: expected a path or a mujoco.MjModel")
    return place, model


@dataclass(frozen=True)
class Joints:
    """Joints of a compiled model.

    Attributes
    ----------
    index : dict of str to int
        Number of each joint, by its name.
    movable : list of str
        Hinges and slides that follow no other joint.
    coupled : set of str
        Joints that follow an equality constraint.
    """

    index: dict[str, int]
    movable: list[str]
    coupled: set[str]

    @classmethod
    def of(cls, model: Any) -> Joints:
        """Returns the joints of a compiled model."""
        import mujoco

        one = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}
        index = {model.joint(k).name or f"joint {k}": k for k in range(model.njnt)}
        follow = {
            int(model.eq_obj1id[k])
            for k in range(model.neq)
            if model.eq_type[k] == mujoco.mjtEq.mjEQ_JOINT and model.eq_active0[k]
        }
        coupled = {name for name, k in index.items() if k in follow}
        movable = [
            name
            for name, k in index.items()
            if int(model.jnt_type[k]) in one and name not in coupled
        ]
        return cls(index, movable, coupled)

    def why_not(self, name: str) -> str:
        """Returns why a joint cannot be moved; "" for an unknown one."""
        if name not in self.index:
            return ""
        if name in self.coupled:
            return f"joint {quoted(name)} follows an equality constraint"
        return f"joint {quoted(name)} is free or a ball joint"
