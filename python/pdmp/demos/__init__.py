"""Demonstrations from files, and trajectories to files.

A CSV file is one demonstration: a header row with names, then one sample a row. By default the
column `t` holds the time in s and every other column is a degree of freedom.

An NPZ file holds several, in one of two layouts, without pickled objects:

- an array (T, D) per demonstration under its own name, and its time stamps (T,), if any, under the
  same name followed by `.t`;
- `y` (ΣT, D) with all samples one demonstration after another, `start` (M + 1,) with the row where
  each begins and the last ends, and the time stamps `t` (ΣT,), if any.

Either may have `names` (D,) of the degrees of freedom.

A folder holds an `index.csv`, one row per demonstration with its name under `id` and whatever else
is known of it, beside `demos/<id>.csv` files or a `demos.npz` in the order of the index.
"""

from pdmp.demos.archive import read_npz
from pdmp.demos.folder import read, read_folder
from pdmp.demos.table import read_csv, write_csv

__all__ = ["read", "read_csv", "read_folder", "read_npz", "write_csv"]
