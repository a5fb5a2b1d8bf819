"""Preparation of raw recordings for `pdmp.fit`.

`unwrap` removes jumps of angles, `lowpass` noise, `trim` periods of rest at both ends; `resample`
gives a constant interval, `split_at` the parts between given times. Each takes one demonstration,
or a sequence or mapping of them as the readers return, and returns a result for each. `cycles`
converts cyclic recordings to demonstrations of a rhythmic primitive::

    cycles = pdmp.preprocessing.cycles(pdmp.io.read_csv("walk.csv"))
    model = pdmp.fit(cycles, kind="rhythmic")

Orientations are arrays along time: `matrices_to_quaternions`, `rotation_vectors_to_quaternions`,
`axis_angles_to_quaternions`, `euler_to_quaternions` and `transforms_to_poses` give the columns that
`pdmp.Demonstration(..., rotations=...)` declares, `quaternions_to_matrices`,
`quaternions_to_rotation_vectors`, `quaternions_to_euler` and `poses_to_transforms` convert back.
"""

from pdmp import _native
from pdmp._native import (
    axis_angles_to_quaternions,
    euler_to_quaternions,
    matrices_to_quaternions,
    poses_to_transforms,
    quaternions_to_euler,
    quaternions_to_matrices,
    quaternions_to_rotation_vectors,
    rotation_vectors_to_quaternions,
    transforms_to_poses,
)
from pdmp.preprocessing import angles
from pdmp.preprocessing._vectorized import vectorized
from pdmp.preprocessing.cyclic import Cycles, Growth, Rejected, cycles

lowpass = vectorized(_native.lowpass)
period = vectorized(_native.period)
resample = vectorized(_native.resample)
split_at = vectorized(_native.split_at)
trim = vectorized(_native.trim)
unwrap = vectorized(angles.unwrap)

__all__ = [
    "Cycles",
    "Growth",
    "Rejected",
    "axis_angles_to_quaternions",
    "cycles",
    "euler_to_quaternions",
    "lowpass",
    "matrices_to_quaternions",
    "period",
    "poses_to_transforms",
    "quaternions_to_euler",
    "quaternions_to_matrices",
    "quaternions_to_rotation_vectors",
    "resample",
    "rotation_vectors_to_quaternions",
    "split_at",
    "transforms_to_poses",
    "trim",
    "unwrap",
]
