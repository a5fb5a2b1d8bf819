"""Recordings into demonstrations, and trajectories to files.

A CSV file is one demonstration: a header row with names, then one sample a row. By default the
column `t` holds the time in s and every other column is a degree of freedom. A header such as
`knee [rad]`, or a row of units below it, gives name and unit. What spreadsheets and pandas write is
read too: semicolons or tabs with decimal commas, an index column, comments before the header.

An NPZ file holds one demonstration or several, in one of three layouts, without pickled objects:

- `position` (T, D), or (M, T, D) of M demonstrations, and its time stamps `time` (T,), if any;
- an array (T, D) per demonstration under its own name, and its time stamps (T,), if any, under the
  same name followed by `.t`;
- `y` (ΣT, D) with all samples one demonstration after another, `start` (M + 1,) with the row where
  each begins and the last ends, and the time stamps `t` (ΣT,), if any.

Each may have `names` (D,) and `units` (D,) of the degrees of freedom.

A BVH file is one demonstration, whose degrees of freedom are the channels of its skeleton.

A folder holds an `index.csv`, one row per demonstration with its name under `id` and more columns
for what is known of it, beside `demos/<id>.csv` or `demos/<id>.bvh` files or a `demos.npz` in the
order of the index. Without an index, all CSV and BVH files in the folder are read.

What was read may be prepared: `unwrap` angles, take noise off by `lowpass`, `resample` evenly,
`trim` to the movement or `cut` at given times; each of these takes one demonstration, a list or
what a reader returned, and returns as many results. From cyclic recordings `cycles` makes what a
rhythmic primitive is learnt from::

    cycles = pdmp.demos.cycles(pdmp.demos.read_csv("walk.csv"))
    model = pdmp.fit(cycles, kind="rhythmic")
"""

from pdmp import _native
from pdmp.demos import angles
from pdmp.demos._each import each
from pdmp.demos.archive import read_npz
from pdmp.demos.bvh import read_bvh
from pdmp.demos.cyclic import Cycles, Growth, Rejected, cycles
from pdmp.demos.folder import read, read_folder
from pdmp.demos.table import read_csv, write_csv

cut = each(_native.cut)
lowpass = each(_native.lowpass)
period = each(_native.period)
resample = each(_native.resample)
trim = each(_native.trim)
unwrap = each(angles.unwrap)

__all__ = [
    "Cycles",
    "Growth",
    "Rejected",
    "cut",
    "cycles",
    "lowpass",
    "period",
    "read",
    "read_bvh",
    "read_csv",
    "read_folder",
    "read_npz",
    "resample",
    "trim",
    "unwrap",
    "write_csv",
]
