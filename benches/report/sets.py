"""Sets of recordings with numeric contexts, each as one or several questions."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pdmp import Demonstration
from recordings import ARM, HAND, is_available, recorded, rows, running_strides, walking_strides

LEGS = [f"{side}_{angle}" for side in "rl" for angle in ("hip_flex", "knee_flex", "ank_dorsi")]
MAX_DEMOS = 120  # of a question; with more, a Gaussian process takes over a second
STRIDES = 3  # of each runner


@dataclass(frozen=True, eq=False)
class Question:
    """Demonstrations and the contexts to predict them from."""

    name: str
    context: str
    unit: str
    demos: list[Demonstration]
    contexts: np.ndarray  # (M, Q)
    options: dict[str, Any] = field(default_factory=dict)  # of `pdmp.evaluate`

    @property
    def source(self) -> str:
        """Name of the set of recordings in `pdmp.datasets.REGISTRY`."""
        return self.name.partition(",")[0]


def questions() -> Iterator[Question]:
    """Yields every question whose recordings are available."""
    for source, ask in ASKED.items():
        if is_available(source):
            yield from ask()


def raised_hands() -> Iterator[Question]:
    """Yields raised hands: up, hold and back, or the rise alone."""
    index = rows("raise_hand_bandai")
    demos = recorded("raise_hand_bandai", ARM)
    heights = numbers(index, "hold_height_m")
    yield Question("raise_hand_bandai, whole", "height held", "rad", demos, heights)
    rises = cut(demos, numbers(index, "rise_start_s", "rise_end_s"))
    yield Question("raise_hand_bandai, rise", "height held", "rad", rises, heights)


def high_and_low() -> Iterator[Question]:
    """Yields high grabs and deposits on the floor by three actors of different size."""
    index = rows("arms_hdm05")
    demos = recorded("arms_hdm05", ARM)
    columns = {"grabHighR": "peak_height_m", "depositFloorR": "low_height_m"}
    heights, chosen = np.full((len(index), 1), np.nan), {}
    for motion, column in columns.items():
        chosen[motion] = [k for k, row in enumerate(index) if row["motion"] == motion]
        heights[chosen[motion]] = numbers(index, column)[chosen[motion]]
    chosen["both"] = sum(chosen.values(), [])
    for name, members in chosen.items():
        some = [demos[k] for k in members]
        yield Question(f"arms_hdm05, {name}", "height of the target", "rad", some, heights[members])


def walking_forces() -> Iterator[Question]:
    """Yields ground forces of five people at many walking speeds."""
    index = rows("walking_force_speed")
    demos = recorded("walking_force_speed")
    speeds = numbers(index, "speed_m_s")
    subjects = np.array([row["subject"] for row in index])
    for subject in np.unique(subjects):
        members = np.flatnonzero(subjects == subject)
        some = [demos[k] for k in members]
        yield Question(
            f"walking_force_speed, subject {subject}", "speed", "BW", some, speeds[members]
        )
    step = -(-len(demos) // MAX_DEMOS)
    yield Question("walking_force_speed, all", "speed", "BW", demos[::step], speeds[::step])


def doors() -> Iterator[Question]:
    """Yields reaches for the handle of a door at many places, and the opening of the door."""
    index = rows("door_adroit")
    demos = recorded("door_adroit", HAND)
    contexts = numbers(index, "door_x", "door_y", "door_z")
    ends = numbers(index, "latch_turns_at_s")
    reaches = cut(demos, np.hstack([0 * ends, ends]))
    yield Question("door_adroit, reach", "place of the door", "rad", reaches, contexts)
    yield Question("door_adroit, whole", "place of the door", "rad", demos, contexts)


def styled_walks() -> Iterator[Question]:
    """Yields walks in ten styles, right foot to right foot; a recording has one speed."""
    speeds = {row["id"]: float(row["speed_m_s"]) for row in rows("walk_styles_bandai")}
    strides, demos = zip(*walking_strides([*ARM, *LEGS], foot="r"), strict=True)
    contexts = np.array([[speeds[stride["id"]]] for stride in strides])
    options = {"kind": "rhythmic"}
    yield Question("walk_styles_bandai", "speed", "rad", list(demos), contexts, options)


def runners() -> Iterator[Question]:
    """Yields strides of runners of different age, height and mass."""
    index = rows("running_strides")
    strides = running_strides()
    seen: dict[str, int] = {}
    members = []
    for k, row in enumerate(index):
        seen[row["runner"]] = seen.get(row["runner"], 0) + 1
        if seen[row["runner"]] <= STRIDES:
            members.append(k)
    demos = [strides[k] for k in members]
    contexts = numbers(index, "age", "height_cm", "mass_kg")[members]
    options = {"kind": "rhythmic"}
    yield Question("running_strides", "age, height, mass", "rad", demos, contexts, options)


def pushes() -> Iterator[Question]:
    """Yields pushes of an object to a target with a planar arm."""
    index = rows("arm3_pushing")
    demos = recorded("arm3_pushing")
    contexts = numbers(index, "object_x", "object_y", "target_x", "target_y")
    yield Question("arm3_pushing", "object and target", "rad", demos, contexts)


ASKED = {
    "raise_hand_bandai": raised_hands,
    "arms_hdm05": high_and_low,
    "walking_force_speed": walking_forces,
    "door_adroit": doors,
    "walk_styles_bandai": styled_walks,
    "running_strides": runners,
    "arm3_pushing": pushes,
}


def numbers(index: list[dict[str, str]], *columns: str) -> np.ndarray:
    """Returns columns of a table (M, Q)."""
    return np.array([[float(row[column]) for column in columns] for row in index])


def cut(demos: list[Demonstration], bounds: np.ndarray) -> list[Demonstration]:
    """Returns the part of each demonstration between two times [s]."""
    parts = []
    for demo, (begin, end) in zip(demos, bounds, strict=True):
        inside = (demo.time >= begin - 1e-3) & (demo.time <= end + 1e-3)
        parts.append(Demonstration(demo.position[inside], time=demo.time[inside], names=demo.names))
    return parts
