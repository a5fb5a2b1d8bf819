"""The paper's figures, made with this library on a simulated robot.

The paper is Matsubara, Hyon, Morimoto, Neural Networks 24 (2011). What lives where, each importing
from above::

    section                 a part of the report
    human, swing            how people reach and swing their arms
    baxter, robot, film     the robot's kinematics, its physics, and pictures of it
    reaching, loop, paths   the demonstrations on the robot, the control loop, what hands did
    one_dof, styles, heights, walking      Fig. 2 to 5, one each
    rivals                  other methods at the same task
    run                     the command
"""

from pdmp.reproduction.run import FIGURES, reproduce

__all__ = ["FIGURES", "reproduce"]
