"""Recordings of people and robots, as far as they are at hand, group by group.

A group is what one primitive is learnt from: the repetitions of one task.
"""

import csv
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from pdmp import Demonstration
from pdmp.datasets import handwriting
from pdmp.io import read_csv, read_folder

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
MOST_DEMOS = 10
MOST_SAMPLES = 400
ARM = ["r_sh1", "r_sh2", "r_sh3", "r_elb"]
# The first 28 columns of the door are joints; what follows is measured from them.
HAND = [
    *["ARTz", "ARRx", "ARRy", "ARRz", "WRJ1", "WRJ0"],
    *[f"{finger}J{joint}" for finger in ("FF", "MF", "RF") for joint in (3, 2, 1, 0)],
    *[f"LFJ{joint}" for joint in (4, 3, 2, 1, 0)],
    *[f"THJ{joint}" for joint in (4, 3, 2, 1, 0)],
]


@dataclass(frozen=True)
class Folder:
    """A set of recordings: which columns it is about, and where the name of a group ends."""

    columns: list[str] | None = None
    group: int = 0  # parts of the id, between underscores, that name the group


DISCRETE = {
    "arm3_pushing": Folder(),
    "arms_hdm05": Folder(ARM, group=1),
    "box_closing_jaco": Folder(["x", "y", "z"]),
    "door_adroit": Folder(HAND),
    "franka_letters": Folder(group=1),
    "franka_tasks": Folder(["x", "y", "z"], group=1),
    "kuka_paths": Folder(group=2),
    "obstacles_xarm": Folder([f"q{joint}" for joint in range(1, 8)]),
    "raise_hand_bandai": Folder(ARM, group=2),
    "walking_force_speed": Folder(group=1),
    "writing_fda": Folder(),
}


@dataclass(frozen=True, eq=False)
class Group:
    """Demonstrations of one task."""

    source: str
    name: str
    kind: Literal["discrete", "rhythmic"]
    demos: list[Demonstration]


def groups() -> Iterator[Group]:
    """Give every group at hand, and tell of the sets that are not."""
    try:
        for shape, demos in handwriting().items():
            yield Group("handwriting", shape, "discrete", [thinned(demo) for demo in demos])
    except ImportError as reason:
        print(f"left out: {reason}")
    for source, folder in DISCRETE.items():
        if not at_hand(source):
            continue
        members = defaultdict(list)
        for name, demo in read_folder(DATA / source, columns=folder.columns).items():
            members["_".join(name.split("_")[: folder.group])].append(thinned(demo))
        for name, demos in members.items():
            yield Group(source, name, "discrete", few(demos))
    if at_hand("gait_boys"):
        boys = read_folder(DATA / "gait_boys").values()
        yield Group("gait_boys", "", "rhythmic", few([cycle(demo.position, 1.0) for demo in boys]))
    if at_hand("running_strides"):
        strides = read_folder(DATA / "running_strides").values()
        # The last of 101 points is the first of the next stride.
        closed = [cycle(demo.position[:-1], 1.0) for demo in strides]
        yield Group("running_strides", "", "rhythmic", few(closed))
    if at_hand("walk_styles_bandai"):
        yield Group("walk_styles_bandai", "", "rhythmic", few(list(styled_walks())))


def at_hand(source: str) -> bool:
    """Say whether a set is there, and tell if it is not."""
    if not (DATA / source).is_dir():
        print(f"left out: {source}, which is not in {DATA}")
        return False
    return True


def few(demos: list[Demonstration]) -> list[Demonstration]:
    """Return at most so many, evenly chosen."""
    return demos[:: -(-len(demos) // MOST_DEMOS)]


def thinned(demo: Demonstration) -> Demonstration:
    """Return a discrete demonstration with at most so many samples, evenly chosen."""
    step = -(-demo.n_samples // MOST_SAMPLES)
    return Demonstration(demo.position[::step], time=demo.time[::step])


def cycle(position: np.ndarray, period: float, names: list[str] | None = None) -> Demonstration:
    """Return one cycle, whose first sample follows upon the last."""
    return Demonstration(position, dt=period / len(position), names=names)


def styled_walks() -> Iterator[Demonstration]:
    """Cut the first stride from each walk, foot strike to foot strike."""
    folder = DATA / "walk_styles_bandai"
    with open(folder / "strides.csv", newline="") as file:
        for stride in csv.DictReader(file):
            if stride["stride"] == "0" and stride["id"].startswith("walk"):
                whole = read_csv(folder / "demos" / f"{stride['id']}.csv", columns=ARM)
                start, end = int(stride["start_frame"]), int(stride["end_frame"])
                yield cycle(whole.position[start:end], float(stride["duration_s"]))
