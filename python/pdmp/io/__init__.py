"""Readers of recordings, and a writer of trajectories.

A CSV file is one demonstration: a header row with names, then one sample a row. By default the
column `t` holds the time in s and every other column is a degree of freedom. A header such as
`knee [rad]`, or a row of units below it, gives name and unit. The forms that spreadsheets and
pandas write are read too: semicolons or tabs with decimal commas, an index column, comments before
the header.

An NPZ file holds one demonstration or several, in one of three layouts, without pickled objects:

- `position` (T, D), or (M, T, D) of M demonstrations, and its time stamps `time` (T,), if any;
- an array (T, D) per demonstration under its own name, and its time stamps (T,), if any, under the
  same name followed by `.t`;
- `y` (ΣT, D) with all samples one demonstration after another, `start` (M + 1,) with the row where
  each begins and the last ends, and the time stamps `t` (ΣT,), if any.

Each may have `names` (D,) and `units` (D,) of the degrees of freedom.

A BVH file is one demonstration, whose degrees of freedom are the channels of its skeleton.

A folder holds an `index.csv`, one row per demonstration with its name under `id` and more columns
for its context, beside `demos/<id>.csv` or `demos/<id>.bvh` files or a `demos.npz` in the order of
the index. Without an index, all CSV and BVH files in the folder are read.

`pdmp.preprocessing` prepares raw recordings for `pdmp.fit`.
"""

from pdmp.io.bvh import read_bvh
from pdmp.io.csv import read_csv, write_csv
from pdmp.io.folder import read, read_folder
from pdmp.io.npz import read_npz

__all__ = ["read", "read_bvh", "read_csv", "read_folder", "read_npz", "write_csv"]
