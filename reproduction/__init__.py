"""Reproduction of the paper's figures with the package pdmp on a simulated robot.

The paper is Matsubara, Hyon, Morimoto, Neural Networks 24 (2011). `python -m reproduction` draws
its figures, `python -m reproduction.demo` learns human handwriting. Modules import only from
modules above them::

    command, metrics, section              command line, reproduction error, section of the report
    human, swing                           models of human reaching and arm swing
    baxter, robot, film                    kinematics, dynamics and pictures of the robot
    reaching, loop, paths                  demonstrations on the robot, control loop, drawings
    one_dof, styles, heights, walking      Figs. 2 to 5
    rivals                                 other methods on the same tasks
    run, __main__                          all figures, command line
    demo                                   handwriting, independent of the paper
"""
