"""Joint limits of a MuJoCo model."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

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
    try:
        import mujoco
    except ImportError:
        raise ImportError("MuJoCo models need the package mujoco: pip install mujoco") from None
    if joints is not None:
        joints = name_list("joints", joints)
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
    one = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}
    names = [model.joint(k).name or f"joint {k}" for k in range(model.njnt)]
    index = {name: k for k, name in enumerate(names)}
    coupled = {
        int(model.eq_obj1id[k])
        for k in range(model.neq)
        if model.eq_type[k] == mujoco.mjtEq.mjEQ_JOINT and model.eq_active0[k]
    }
    movable = [
        name for name, k in index.items() if int(model.jnt_type[k]) in one and k not in coupled
    ]

    def why_not(name: str) -> str:
        if name not in index:
            return ""
        if index[name] in coupled:
            return f"joint {quoted(name)} follows an equality constraint"
        return f"joint {quoted(name)} is free or a ball joint"

    chosen_names = chosen(place, movable, joints, why_not)
    described = []
    for name in chosen_names:
        lower, upper = map(float, model.jnt_range[index[name]])
        limited = bool(model.jnt_limited[index[name]])
        # MuJoCo takes a range in the wrong order for none, unless the file limits the joint.
        if limited or lower > upper:
            check_range(f"{place}, joint {quoted(name)}", lower, upper)
        described.append(Joint(lower, upper) if limited else Joint())
    return combined(chosen_names, described, given)
