"""Joint limits of robots as their makers publish them, each with its source.

`REGISTRY` has them by the name of the robot; `Limits.from_urdf` and `Limits.from_mujoco` read
those in a robot's own description::

    limits = pdmp.robots.REGISTRY["panda"].limits()
    limits = pdmp.Limits.from_urdf("robot.urdf", model.names, acceleration=8.0)
    controller = model.controller(limits=limits)

Makers seldom publish limits of acceleration, and neither description has them as a rule: pass
`acceleration=` with a value that the robot is known to follow.
"""

from pdmp.robots._registry import REGISTRY
from pdmp.robots._robot import Robot

__all__ = ["REGISTRY", "Robot"]
