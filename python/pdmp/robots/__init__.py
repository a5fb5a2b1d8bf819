"""Joint limits of robots: published ones, and those in a robot's own description.

`REGISTRY` has the limits of some robots as their makers publish them, each with its source;
`limits_from_urdf` and `limits_from_mujoco` read them from a description::

    limits = pdmp.robots.REGISTRY["panda"].limits()
    limits = pdmp.robots.limits_from_urdf("robot.urdf", model.names, acceleration=8.0)
    controller = model.controller(limits=limits)

Makers seldom publish limits of acceleration, and neither description has them as a rule: pass
`acceleration=` with a value that the robot is known to follow.
"""

from pdmp.robots._mujoco import limits_from_mujoco
from pdmp.robots._registry import REGISTRY
from pdmp.robots._robot import Robot
from pdmp.robots._urdf import limits_from_urdf

__all__ = ["REGISTRY", "Robot", "limits_from_mujoco", "limits_from_urdf"]
