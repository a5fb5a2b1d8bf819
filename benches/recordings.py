"""Recordings of people and robots in groups, from the folder in PDMP_DATA.

A group has the repetitions of one task, the demonstrations of one primitive.
"""

import csv
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pdmp import Demonstration
from pdmp._markdown import markdown_table
from pdmp.datasets import REGISTRY, folder, handwriting
from pdmp.io import read_csv, read_folder

MAX_DEMOS = 10
MAX_SAMPLES = 400
SOURCES = """\
## Sources of the recordings

Recordings are converted to the form that `pdmp.io.read_folder` reads, and found below the folder
that the environment variable `PDMP_DATA` names. `pdmp.datasets.REGISTRY` holds this table.
"""
ARM = ["r_sh1", "r_sh2", "r_sh3", "r_elb"]
# The first 28 columns of the door are joints; the others are computed from them.
HAND = [
    *["ARTz", "ARRx", "ARRy", "ARRz", "WRJ1", "WRJ0"],
    *[f"{finger}J{joint}" for finger in ("FF", "MF", "RF") for joint in (3, 2, 1, 0)],
    *[f"LFJ{joint}" for joint in (4, 3, 2, 1, 0)],
    *[f"THJ{joint}" for joint in (4, 3, 2, 1, 0)],
]


@dataclass(frozen=True)
class Selection:
    """Columns of a set of recordings, and the part of an id that names its group."""

    columns: list[str] | None = None
    group: int = 0  # number of parts of the id, between underscores, that name the group


DISCRETE = {
    "arm3_pushing": Selection(),
    "arms_hdm05": Selection(ARM, group=1),
    "box_closing_jaco": Selection(["x", "y", "z"]),
    "door_adroit": Selection(HAND),
    "franka_letters": Selection(group=1),
    "franka_tasks": Selection(["x", "y", "z"], group=1),
    "kuka_paths": Selection(group=2),
    "obstacles_xarm": Selection([f"q{joint}" for joint in range(1, 8)]),
    "raise_hand_bandai": Selection(ARM, group=2),
    "walking_force_speed": Selection(group=1),
    "writing_fda": Selection(),
}


@dataclass(frozen=True, eq=False)
class Group:
    """Demonstrations of one task."""

    source: str
    name: str
    kind: Literal["discrete", "rhythmic"]
    demos: list[Demonstration]


def groups() -> Iterator[Group]:
    """Yields every available group, and prints why others are not available."""
    for source, tasks in discrete():
        for name, demos in tasks.items():
            yield Group(source, name, "discrete", [thinned(demo) for demo in few(demos)])
    if is_available("gait_boys"):
        boys = [cycle(demo.position, 1.0) for demo in recorded("gait_boys")]
        yield Group("gait_boys", "", "rhythmic", few(boys))
    if is_available("running_strides"):
        yield Group("running_strides", "", "rhythmic", few(running_strides()))
    if is_available("walk_styles_bandai"):
        walks = [demo for _, demo in walking_strides(ARM, stride="0")]
        yield Group("walk_styles_bandai", "", "rhythmic", few(walks))


def discrete() -> Iterator[tuple[str, dict[str, list[Demonstration]]]]:
    """Yields every available set of discrete movements as its name and its tasks.

    Prints why others are not available. A task has its demonstrations with all their samples.
    """
    try:
        yield "handwriting", {shape: list(demos) for shape, demos in handwriting().items()}
    except ImportError as reason:
        print(f"left out: {reason}")
    for source, selection in DISCRETE.items():
        if not is_available(source):
            continue
        tasks = defaultdict(list)
        for name, demo in read_folder(folder(source), columns=selection.columns).items():
            tasks["_".join(name.split("_")[: selection.group])].append(demo)
        yield source, tasks


def is_available(source: str) -> bool:
    """Returns True if a set of recordings is available, and prints the reason otherwise."""
    try:
        folder(source)
    except FileNotFoundError as reason:
        print(f"left out: {reason}")
        return False
    return True


def sources(names: Iterable[str]) -> str:
    """Returns a section in Markdown on the sources, licences and contents of some sets."""
    header = ["recordings", "contents", "number", "what varies", "units", "source", "licence"]
    rows = [
        [
            recordings.name,
            recordings.contents,
            recordings.n_recordings,
            recordings.varies,
            recordings.units,
            f"[{recordings.source}]({recordings.url})",
            "; ".join(filter(None, (recordings.licence, recordings.credit))),
        ]
        for recordings in map(REGISTRY.__getitem__, names)
    ]
    return f"{SOURCES}\n{markdown_table(header, rows, n_names=len(header))}"


def few(demos: list[Demonstration]) -> list[Demonstration]:
    """Returns at most MAX_DEMOS demonstrations, evenly spaced."""
    return demos[:: -(-len(demos) // MAX_DEMOS)]


def thinned(demo: Demonstration) -> Demonstration:
    """Returns a discrete demonstration with at most MAX_SAMPLES samples, evenly spaced."""
    step = -(-demo.n_samples // MAX_SAMPLES)
    return Demonstration(demo.position[::step], time=demo.time[::step])


def cycle(position: np.ndarray, period: float, names: list[str] | None = None) -> Demonstration:
    """Returns one cycle, whose first sample follows the last."""
    return Demonstration(position, dt=period / len(position), names=names)


def rows(source: str, name: str = "index.csv") -> list[dict[str, str]]:
    """Reads a table of a set."""
    with open(folder(source) / name, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def recorded(source: str, columns: list[str] | None = None) -> list[Demonstration]:
    """Reads the demonstrations of a set, in the order of its index."""
    return list(read_folder(folder(source), columns=columns).values())


def running_strides() -> list[Demonstration]:
    """Reads the strides of runners; the last of 101 samples is the first of the next stride."""
    strides = recorded("running_strides")
    return [cycle(demo.position[:-1], 1.0, demo.names) for demo in strides]


def walking_strides(
    columns: list[str], **selected: str
) -> Iterator[tuple[dict[str, str], Demonstration]]:
    """Yields the selected strides of each walk, foot strike to foot strike, with their rows."""
    source = "walk_styles_bandai"
    for stride in rows(source, "strides.csv"):
        if stride["id"].startswith("walk") and selected.items() <= stride.items():
            path = folder(source) / "demos" / f"{stride['id']}.csv"
            demo = read_csv(path, columns=columns)
            position = demo.position[int(stride["start_frame"]) : int(stride["end_frame"])]
            yield stride, cycle(position, float(stride["duration_s"]), demo.names)
