"""Readers of recordings, and writers of movements.

Each format has a function; `read` takes files and folders of any of them, and is what the command
line uses. `read_blocks` splits more of them than memory holds into blocks for `pdmp.fit`. Readers
of formats that hold one movement return a `Demonstration`, those of formats that hold several a
dict of them by name. All have the options `columns`, `dt`, `max_gap` and `context`. The packages
that read a format are extras, as in `pip install 'pdmp[rosbag]'`, and are imported at the first
use.

=============================  =================  ==============================================
files                          extra              functions
=============================  =================  ==============================================
`.csv`, `.tsv`                                    `read_csv`, `write_csv`
`.npz`                                            `read_npz`
a folder of files                                 `read_folder`
`.parquet`                     `parquet`          `read_parquet`, `write_parquet`
data frames, xarray                               `from_dataframe`, `from_xarray`
LeRobot 3.0 and 2.1            `lerobot`          `read_lerobot`, `write_lerobot`
ROS bags: MCAP, `.db3`         `rosbag`           `read_rosbag`, `write_rosbag`
`.hdf5` of robomimic           `hdf5`             `read_hdf5`
`.c3d`                                            `read_c3d`
`.trc`, `.mot`, `.sto`                            `read_opensim`
`.bvh`                         `bvh`              `read_bvh`
`.mat`                                            `read_mat`
=============================  =================  ==============================================

A CSV file is one demonstration: a header row with names, then one sample per row. By default the
column `t` or `time` is the time in s and every other column a degree of freedom. A header such as
`knee [rad]`, or a row of units below it, gives name and unit. The forms of spreadsheets and pandas
are read too: semicolons or tabs with decimal commas, an index column, comments before the header.
So are the exports of Vicon, OptiTrack and Qualisys.

An NPZ file has one or several demonstrations, in one of three layouts without pickled objects:

- `position` (T, D), or (M, T, D) for M demonstrations, and optional time stamps `time` (T,);
- an array `NAME` (T, D) per demonstration, and its optional time stamps `NAME.t` (T,);
- the concatenated samples `y` (ΣT, D) of all demonstrations, `start` (M + 1,) with the row where
  each begins and the last ends, and optional time stamps `t` (ΣT,).

Each layout may have `names` (D,) and `units` (D,) of the degrees of freedom.

A folder has an `index.csv`, with a row per demonstration, its name in the column `id` and its
context in others, and files `demos/<id>.csv`, or of another format with one demonstration, or a
`demos.npz` in the order of the index. Without an index, all such files in the folder are read, or
all NPZ files if there are no others.

`pdmp.preprocessing` prepares raw recordings for `pdmp.fit`.
"""

from importlib import import_module as _import_module
from typing import TYPE_CHECKING as _TYPE_CHECKING

if _TYPE_CHECKING:
    from pdmp.io._blocks import read_blocks
    from pdmp.io._lerobot_writer import write_lerobot
    from pdmp.io._read import read
    from pdmp.io.bvh import read_bvh
    from pdmp.io.c3d import read_c3d
    from pdmp.io.csv import read_csv, write_csv
    from pdmp.io.folder import read_folder
    from pdmp.io.frames import from_dataframe
    from pdmp.io.hdf5 import read_hdf5
    from pdmp.io.labelled import from_xarray
    from pdmp.io.lerobot import read_lerobot
    from pdmp.io.mat import read_mat
    from pdmp.io.npz import read_npz
    from pdmp.io.opensim import read_opensim
    from pdmp.io.parquet import read_parquet, write_parquet
    from pdmp.io.rosbag import read_rosbag, write_rosbag
else:
    _HOMES = {
        "from_dataframe": "frames",
        "from_xarray": "labelled",
        "read": "_read",
        "read_blocks": "_blocks",
        "read_bvh": "bvh",
        "read_c3d": "c3d",
        "read_csv": "csv",
        "read_folder": "folder",
        "read_hdf5": "hdf5",
        "read_lerobot": "lerobot",
        "read_mat": "mat",
        "read_npz": "npz",
        "read_opensim": "opensim",
        "read_parquet": "parquet",
        "read_rosbag": "rosbag",
        "write_csv": "csv",
        "write_lerobot": "_lerobot_writer",
        "write_parquet": "parquet",
        "write_rosbag": "rosbag",
    }

    def __getattr__(name: str) -> object:
        """Imports readers and writers at their first use, which a control loop does not need."""
        if name not in _HOMES:
            raise AttributeError(f"module 'pdmp.io' has no attribute '{name}'")
        found = getattr(_import_module(f"pdmp.io.{_HOMES[name]}"), name)
        globals()[name] = found
        return found


def __dir__() -> list[str]:
    return sorted(__all__)


__all__ = [
    "from_dataframe",
    "from_xarray",
    "read",
    "read_blocks",
    "read_bvh",
    "read_c3d",
    "read_csv",
    "read_folder",
    "read_hdf5",
    "read_lerobot",
    "read_mat",
    "read_npz",
    "read_opensim",
    "read_parquet",
    "read_rosbag",
    "write_csv",
    "write_lerobot",
    "write_parquet",
    "write_rosbag",
]
