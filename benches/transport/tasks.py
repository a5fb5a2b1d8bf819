"""Tasks: the demonstrations of one primitive, from every available set of discrete movements."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pdmp import Demonstration
from pdmp.datasets import folder
from pdmp.io import read_folder
from recordings import ARM, discrete
from report.sets import cut, numbers, rows


@dataclass(frozen=True, eq=False)
class Task:
    """Demonstrations of one task."""

    source: str
    name: str
    demos: list[Demonstration]


def tasks() -> Iterator[Task]:
    """Yields every available task with all its demonstrations and samples."""
    for source, members in discrete():
        for name, demos in members.items():
            yield Task(source, name, demos)
        if source == "raise_hand_bandai":
            yield from rises(members)


def rises(members: dict[str, list[Demonstration]]) -> Iterator[Task]:
    """Yields the rises of the raised hands, which end where the hand is held."""
    index = rows("raise_hand_bandai")
    hands = read_folder(folder("raise_hand_bandai"), columns=ARM)
    bounds = dict(zip(hands, numbers(index, "rise_start_s", "rise_end_s"), strict=True))
    for group in members:
        names = [name for name in hands if name.startswith(group)]
        demos = cut([hands[name] for name in names], np.array([bounds[name] for name in names]))
        yield Task("raise_hand_bandai, rise", group, demos)
