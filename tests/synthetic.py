"""Small families of movements for the tests."""

import numpy as np

import pdmp

DT = 0.02

BVH = """HIERARCHY
ROOT Hips
{
\tOFFSET 0 0 0
\tCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation

\tJOINT Left Leg
\t{
\t\tOFFSET 0 -40 0
\t\tCHANNELS 4 Yposition Zrotation Xrotation Yrotation
\t\tEnd Site
\t\t{
\t\t\tOFFSET 0 -40 0
\t\t}
\t}
}
MOTION
Frames:\t4
Frame Time: 0.01
0 90 0 10 20 30 1 100 -170 5
0 91 1 10 20 30 1 110 -180 5
0 92 2 10 20 30 1 120 -190 5
0 93 3 10 20 30 1 130 -200 5"""
"""BVH file of two joints and four frames, with a blank line and without a final line break."""


def reaches() -> list[pdmp.Demonstration]:
    """Returns five planar minimum-jerk reaches that differ in bend, goal and duration."""
    demos = []
    for bend in (-0.2, -0.1, 0.0, 0.1, 0.2):
        s = np.linspace(0, 1, 61 + round(50 * bend))
        forward = (1 + bend) * s**3 * (10 - 15 * s + 6 * s**2)
        sideways = bend * 64 * (s * (1 - s)) ** 3
        position = np.column_stack([forward, sideways])
        demos.append(
            pdmp.Demonstration(position, dt=DT, context=[bend], names=["x", "y"], units=["m", "m"])
        )
    return demos


def loops() -> list[pdmp.Demonstration]:
    """Returns three planar loops from a circle to a figure of eight, one cycle of 2 s each."""
    phi = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    return [
        pdmp.Demonstration(
            np.column_stack([np.cos(phi), (1 - k) * np.sin(phi) + k * np.sin(2 * phi)]),
            dt=DT,
            units=["m", "m"],
        )
        for k in (0.0, 0.5, 1.0)
    ]
