"""Positions and times of messages of ROS."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmp._messages import value_error
from pdmp._native import Demonstration, Trajectory
from pdmp.io._demonstration import Options, select

POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
Messages = Sequence[tuple[int, Any]]  # time of the recording [ns], and message


@dataclass
class Recording:
    """Positions, times and names of one demonstration."""

    position: NDArray[np.float64]
    time: NDArray[np.float64]
    names: list[str]
    units: list[str]
    rotations: dict[str, str] = field(default_factory=dict)

    def demonstration(self, source: str, options: Options) -> Demonstration:
        """Returns the demonstration of the columns to keep."""
        return select(
            source,
            options,
            self.position,
            self.names,
            self.units,
            time=self.time,
            rotations=self.rotations,
        )


def kind(message_type: str) -> str:
    """Returns the name of a type in `READERS`, or "" for another one."""
    name = message_type.rpartition("/")[2]
    return name if name in READERS else ""


def _joint_states(source: str, messages: Messages, columns: Any) -> Iterator[Recording]:
    """Yields the recording of the joints of a topic, in the order of the first message."""
    sets = Counter(tuple(message.name) for _, message in messages if len(message.position))
    if not sets:
        raise value_error(f"{source}: the messages have no positions")
    names = next(iter(sets))
    if columns is not None and any(set(columns) <= set(each) for each in sets):
        sets = Counter({each: n for each, n in sets.items() if set(columns) <= set(each)})
        names = tuple(columns)
    elif len({frozenset(each) for each in sets}) > 1:
        groups = " | ".join(", ".join(each) for each in sets)
        raise value_error(
            f"{source}: messages name different joints: pass columns= with some of {groups}"
        )
    kept, rows = [], []
    for stamp, message in messages:
        own = list(message.name)
        if tuple(own) in sets and len(message.position):
            if len(message.position) != max(len(own), 1) and own:
                raise value_error(
                    f"{source}: {len(message.position)} positions of {len(own)} joints"
                )
            values = message.position[list(map(own.index, names))] if own else message.position
            rows.append(values.tolist())
            kept.append((stamp, message))
    if len({len(row) for row in rows}) > 1:
        raise value_error(f"{source}: numbers of positions differ between messages")
    labels = list(names) or [f"y{d}" for d in range(len(rows[0]))]
    yield Recording(np.array(rows, float), _times(kept), labels, [""] * len(labels))


def _poses(source: str, messages: Messages, columns: Any) -> Iterator[Recording]:
    """Yields the recording of the poses of a topic."""
    rows = []
    for _, message in messages:
        place, turn = message.pose.position, message.pose.orientation
        rows.append([place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w])
    units = ["m"] * 3 + [""] * 4
    yield Recording(np.array(rows, float), _times(messages), list(POSE), units, {"qx": "xyzw"})


def _trajectories(source: str, messages: Messages, columns: Any) -> Iterator[Recording]:
    """Yields each trajectory of a topic; points without positions are not recordings."""
    for k, (_, message) in enumerate(messages):
        names = list(message.joint_names)
        rows = [list(map(float, point.positions)) for point in message.points]
        if not rows or {len(row) for row in rows} != {len(names)}:
            raise value_error(
                f"{source}, message {k}: expected points with {len(names)} positions each"
            )
        times = [_nanoseconds(point.time_from_start) * 1e-9 for point in message.points]
        yield Recording(np.array(rows), np.array(times), names, [""] * len(names))


READERS = {"JointState": _joint_states, "PoseStamped": _poses, "JointTrajectory": _trajectories}
"""Readers by the name of the type of messages."""


def _times(messages: Messages) -> NDArray[np.float64]:
    """Returns times [s] since the first, of the headers if they have any."""
    stamps = np.array([_nanoseconds(message.header.stamp) for _, message in messages])
    if not stamps.any():
        stamps = np.array([stamp for stamp, _ in messages])
    return np.asarray((stamps - stamps[0]) * 1e-9)


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def joint_trajectory(types: Any, trajectory: Trajectory, names: list[str]) -> Any:
    """Returns a trajectory as a message of these types, with times from its first sample."""
    points = [
        types["trajectory_msgs/msg/JointTrajectoryPoint"](
            positions=position,
            velocities=velocity,
            accelerations=acceleration,
            effort=np.zeros(0),
            time_from_start=types["builtin_interfaces/msg/Duration"](*divmod(nanoseconds, 10**9)),
        )
        for nanoseconds, position, velocity, acceleration in zip(
            np.round((trajectory.time - trajectory.time[0]) * 1e9).astype(int).tolist(),
            trajectory.position,
            trajectory.velocity,
            trajectory.acceleration,
            strict=True,
        )
    ]
    stamp = types["builtin_interfaces/msg/Time"](0, 0)
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="")
    return types["trajectory_msgs/msg/JointTrajectory"](
        header=header, joint_names=names, points=points
    )
