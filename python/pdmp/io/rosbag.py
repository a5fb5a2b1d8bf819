"""Reader of ROS bags, and writer of a trajectory as a bag."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

from pdmp._files import file_path, new_folder
from pdmp._labels import name_list
from pdmp._messages import check_type, value_error
from pdmp._native import Demonstration, Trajectory
from pdmp.io import _ros_messages
from pdmp.io._demonstration import Options
from pdmp.io._packages import load, reading

FILES = "ROS bags"
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"


def read_rosbag(
    path: str | PathLike[str],
    *,
    topic: str | None = None,
    columns: Sequence[str] | None = None,
    dt: float | None = None,
    max_gap: float = 0.0,
    context: Sequence[float | str] | None = None,
) -> dict[str, Demonstration]:
    """Reads the demonstrations of one topic of a ROS bag; needs the extra `rosbag`.

    Bags are folders of rosbag2, single MCAP or SQLite files, or bags of ROS 1. ROS need not be
    installed. The messages of a topic are of one of these types:

    - `sensor_msgs/JointState`: one demonstration, whose degrees of freedom are the joints;
    - `geometry_msgs/PoseStamped`: one demonstration of x, y and z [m] and the rotation qx, qy, qz
      and qw;
    - `trajectory_msgs/JointTrajectory`: one demonstration per message.

    Times are the stamps in the headers, relative to the first, or those of the recording where the
    headers have none. Units of joints are not stated by the messages.

    Parameters
    ----------
    path : path
        A folder with a `metadata.yaml`, or an MCAP, db3 or bag file.
    topic : str, optional
        Topic to read; by default the only one of these types.
    columns : sequence of str, optional
        Names of the degrees of freedom to keep, in this order; all by default. Messages without
        one of them, such as those of another robot, are skipped.
    dt : float, optional
        Sampling interval [s], instead of time stamps.
    max_gap : float
        Longest gap [s], a run of NaN, to interpolate; by default 0, none.
    context : sequence of float or str, optional
        Context (Q,) of the demonstrations.

    Returns
    -------
    dict
        Demonstrations by the name of the topic, followed by the number of the message for joint
        trajectories.

    Raises
    ------
    ImportError
        The package rosbags is not installed.
    ValueError
        A file that is not a bag, several topics or none, messages of different joints, or data that
        `Demonstration` rejects.
    OSError
        A file that cannot be read.

    See Also
    --------
    write_rosbag : Writes a trajectory as a bag.
    """
    path = file_path(path)
    options = Options(columns, dt, max_gap, context)
    check_type("topic", topic, (str, type(None)), "the name of a topic")
    with _opened(path) as bag:
        connections = _connections(path, bag, topic)
        name, kind = connections[0].topic, _ros_messages.kind(connections[0].msgtype)
        messages = []
        with reading(path, "ROS bag"):
            for connection, stamp, data in bag.messages(connections=connections):
                messages.append((stamp, bag.deserialize(data, connection.msgtype)))
    if not messages:
        raise value_error(f"{path}: no messages of topic '{name}'")
    source = f"{path}, topic '{name}'"
    with reading(path, "ROS bag"):
        # Fields of damaged messages may have any type.
        recordings = list(_ros_messages.READERS[kind](source, messages, options.columns))
    single = kind != "JointTrajectory"
    return {
        name if single else f"{name}/{k}": recording.demonstration(
            source if single else f"{source}, message {k}", options
        )
        for k, recording in enumerate(recordings)
    }


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    anyreader = load("rosbags.highlevel", "rosbag", FILES)
    typesys = load("rosbags.typesys", "rosbag", FILES)
    types = typesys.get_typestore(typesys.Stores.LATEST)
    if not path.exists():
        path.stat()  # raises the error of the system
    with reading(path, "ROS bag"):
        bag = anyreader.AnyReader([path], default_typestore=types)
        bag.open()
    try:
        yield bag
    finally:
        bag.close()


def _connections(path: Path, bag: Any, topic: str | None) -> list[Any]:
    """Returns the connections of a topic, or of the only readable one."""
    readable = [each for each in bag.connections if _ros_messages.kind(each.msgtype)]
    topics = sorted({each.topic for each in readable})
    found = [each for each in readable if each.topic == (topic or (topics or [""])[0])]
    if topic is None and len(topics) > 1:
        raise value_error(f"{path}: several topics, pass topic= one of {', '.join(topics)}")
    if not found:
        kinds = ", ".join(_ros_messages.READERS)
        wanted = f"topic '{topic}'" if topic else "topic"
        raise value_error(f"{path}: no {wanted} of {kinds} among {', '.join(topics) or 'none'}")
    if len({each.msgtype for each in found}) > 1:
        raise value_error(f"{path}: topic '{found[0].topic}' has messages of several types")
    return found


def write_rosbag(
    path: str | PathLike[str],
    trajectory: Trajectory,
    *,
    topic: str = "/joint_trajectory",
    names: Sequence[str] | None = None,
) -> None:
    """Writes a trajectory as a ROS bag; needs the extra `rosbag`.

    The bag is a folder of rosbag2 with an MCAP file, for `ros2 bag play`. It has one message of the
    type `trajectory_msgs/JointTrajectory`, whose points have the positions, velocities and
    accelerations of the samples. `read_rosbag` reads it back. ROS need not be installed.

    Parameters
    ----------
    path : path
        Folder to write, which must not exist.
    trajectory : Trajectory
        A rollout without rotations.
    topic : str
        Topic of the message.
    names : sequence of str, optional
        Names of the D joints, instead of the trajectory's.

    Raises
    ------
    ImportError
        The package rosbags is not installed.
    ValueError
        A trajectory with rotations, or a number of names other than D.
    OSError
        A folder that exists, or that cannot be written.
    """
    path = file_path(path)
    check_type("trajectory", trajectory, Trajectory, "pdmp.Trajectory")
    check_type("topic", topic, str, "the name of a topic")
    joints = trajectory.names if names is None else name_list("names", names)
    if trajectory.rotations:
        raise ValueError("trajectory has rotations, which are no joints")
    if len(joints) != trajectory.position.shape[1]:
        raise value_error(
            f"names has length {len(joints)}, expected {trajectory.position.shape[1]}: one per DoF"
        )
    rosbag2 = load("rosbags.rosbag2", "rosbag", FILES)
    typesys = load("rosbags.typesys", "rosbag", FILES)
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    message = _ros_messages.joint_trajectory(store.types, trajectory, joints)
    with new_folder(path) as draft:
        plugin = rosbag2.StoragePlugin.MCAP
        with rosbag2.Writer(draft / path.name, version=9, storage_plugin=plugin) as writer:
            connection = writer.add_connection(topic, TRAJECTORY, typestore=store)
            writer.write(connection, 0, store.serialize_cdr(message, TRAJECTORY))
