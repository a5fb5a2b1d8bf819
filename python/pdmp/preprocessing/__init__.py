"""Preparation of raw recordings for `pdmp.fit`.

`unwrap` removes jumps of angles, `lowpass` noise, `trim` periods of rest at both ends; `resample`
gives a constant interval, `split_at` the parts between given times. Each takes one demonstration,
or a sequence or mapping of them as the readers return, and returns a result for each. `cycles`
converts cyclic recordings to demonstrations of a rhythmic primitive::

    cycles = pdmp.preprocessing.cycles(pdmp.io.read_csv("walk.csv"))
    model = pdmp.fit(cycles, kind="rhythmic")
"""

from pdmp import _native
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
    "cycles",
    "lowpass",
    "period",
    "resample",
    "split_at",
    "trim",
    "unwrap",
]
