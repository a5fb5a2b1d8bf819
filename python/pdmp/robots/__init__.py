"""Joint limits of robots as their makers publish them, each with its source, and kinematics.

`REGISTRY` has limits by the name of the robot; `Limits.from_urdf` and `Limits.from_mujoco` read
those in a robot's own description::

    limits = pdmp.robots.REGISTRY["panda"].limits()
    limits = pdmp.Limits.from_urdf("robot.urdf", model.names, acceleration=8.0)
    controller = model.controller(limits=limits)

Makers seldom publish limits of acceleration, and neither description has them as a rule: pass
`acceleration=` with a value that the robot is known to follow.

`Kinematics` is the protocol between a primitive of poses and the joints of a robot: the pose of a
frame at joint positions, for `measured=`, and its Jacobian, for differential inverse kinematics::

    arm = pdmp.robots.MujocoKinematics("robot.xml", site="gripper")
    controller.step(measured=arm.forward(joint_positions))

`absolute_relative` and `left_right` convert between the poses of two arms and an absolute and a
relative pose, in which a primitive keeps a rigid object between the hands.
"""

from pdmp._native import absolute_relative, left_right, mean_pose
from pdmp.robots._kinematics import Kinematics
from pdmp.robots._mujoco_kinematics import MujocoKinematics
from pdmp.robots._pinocchio import PinocchioKinematics
from pdmp.robots._registry import REGISTRY
from pdmp.robots._robot import Robot

__all__ = [
    "REGISTRY",
    "Kinematics",
    "MujocoKinematics",
    "PinocchioKinematics",
    "Robot",
    "absolute_relative",
    "left_right",
    "mean_pose",
]
