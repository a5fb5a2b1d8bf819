"""Files of recordings, written by the libraries of their formats."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

RATE = 100.0  # Hz
N_SAMPLES = 40
TIME = np.arange(N_SAMPLES) / RATE
JOINTS = ["shoulder", "elbow", "wrist"]


def path_of(seed: int, n_dofs: int = 3, n_samples: int = N_SAMPLES) -> np.ndarray:
    """Returns smooth positions (T, D)."""
    rng = np.random.default_rng(seed)
    s = np.linspace(0, 1, n_samples)[:, None]
    return rng.normal(size=n_dofs) * np.sin(np.pi * s) + rng.normal(size=n_dofs) * s


def quaternions(n_samples: int = N_SAMPLES) -> np.ndarray:
    """Returns unit quaternions (T, 4) of a turn about z, in the order x, y, z, w."""
    angle = np.linspace(0.1, 1.2, n_samples)
    zeros = np.zeros(n_samples)
    return np.column_stack([zeros, zeros, np.sin(angle / 2), np.cos(angle / 2)])


def write_lerobot(path: Path, version: str, paths: list[np.ndarray]) -> Path:
    """Writes a LeRobot data set of two files in the layout of a version."""
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    (path / "meta").mkdir(parents=True)
    n_dofs = paths[0].shape[1]
    features = {
        "observation.state": {"dtype": "float32", "shape": [n_dofs], "names": JOINTS},
        "action": {"dtype": "float32", "shape": [n_dofs], "names": {"motors": JOINTS}},
        "observation.load": {"dtype": "float32", "shape": [1], "names": None},
        "observation.images.top": {"dtype": "video", "shape": [48, 64, 3], "names": None},
    }
    info = {"codebase_version": version, "fps": int(RATE), "features": features}
    (path / "meta" / "info.json").write_text(json.dumps(info))

    def frames(episode: int) -> Any:
        position, n = paths[episode].astype("f4"), len(paths[episode])
        lists = pyarrow.FixedSizeListArray.from_arrays(position.ravel(), n_dofs)
        return pyarrow.table(
            {
                "observation.state": lists if version == "v3.0" else position.tolist(),
                "action": (position + 1).tolist(),
                "observation.load": np.full(n, 0.5 * episode, "f4"),
                "timestamp": (np.arange(n) / RATE).astype("f4"),
                "frame_index": np.arange(n),
                "episode_index": np.full(n, episode),
            }
        )

    rows = [
        {"episode_index": k, "length": len(each), "tasks": [f"task {k % 2}"]}
        for k, each in enumerate(paths)
    ]
    folder = path / "data" / "chunk-000"
    folder.mkdir(parents=True)
    if version == "v3.0":
        half = len(paths) // 2
        for k, part in enumerate([range(half), range(half, len(paths))]):
            for episode in part:
                rows[episode] |= {"data/chunk_index": 0, "data/file_index": k}
            tables = [frames(episode).cast(frames(0).schema) for episode in part]
            parquet.write_table(pyarrow.concat_tables(tables), folder / f"file-{k:03d}.parquet")
        episodes = path / "meta" / "episodes" / "chunk-000"
        episodes.mkdir(parents=True)
        parquet.write_table(pyarrow.Table.from_pylist(rows), episodes / "file-000.parquet")
    else:
        for k in range(len(paths)):
            parquet.write_table(frames(k), folder / f"episode_{k:06d}.parquet")
        lines = "\n".join(map(json.dumps, rows))
        (path / "meta" / "episodes.jsonl").write_text(lines)
    return path


def write_bag(path: Path, kind: str, *, storage: str = "MCAP", stamped: bool = True) -> Path:
    """Writes a bag of rosbag2 with joints, poses or trajectories, by rosbags."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    types = store.types
    position, turns = path_of(0), quaternions()

    def header(nanoseconds: int) -> Any:
        stamp = types["builtin_interfaces/msg/Time"](*divmod(nanoseconds if stamped else 0, 10**9))
        return types["std_msgs/msg/Header"](stamp=stamp, frame_id="base")

    def message(k: int, nanoseconds: int) -> Any:
        if kind == "sensor_msgs/msg/JointState":
            order = [0, 1, 2] if k % 2 else [2, 0, 1]
            return types[kind](
                header=header(nanoseconds),
                name=[JOINTS[i] for i in ([0, 1, 2] if k == 0 else order)],
                position=position[k][[0, 1, 2] if k == 0 else order],
                velocity=np.zeros(0),
                effort=np.zeros(0),
            )
        if kind == "geometry_msgs/msg/PoseStamped":
            pose = types["geometry_msgs/msg/Pose"](
                position=types["geometry_msgs/msg/Point"](*position[k]),
                orientation=types["geometry_msgs/msg/Quaternion"](*turns[k]),
            )
            return types[kind](header=header(nanoseconds), pose=pose)
        return types[kind](
            header=header(0),
            joint_names=JOINTS,
            points=[
                types["trajectory_msgs/msg/JointTrajectoryPoint"](
                    positions=row,
                    velocities=np.zeros(3),
                    accelerations=np.zeros(3),
                    effort=np.zeros(0),
                    time_from_start=types["builtin_interfaces/msg/Duration"](
                        *divmod(i * 10**7, 10**9)
                    ),
                )
                for i, row in enumerate(path_of(k))
            ],
        )

    plugin = getattr(rosbag2.StoragePlugin, storage)
    with rosbag2.Writer(path, version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection("/arm", kind, typestore=store)
        n_messages = 2 if "Trajectory" in kind else N_SAMPLES
        for k in range(n_messages):
            nanoseconds = 1_700_000_000_000_000_000 + k * 10**7
            data = store.serialize_cdr(message(k, nanoseconds), kind)
            writer.write(connection, nanoseconds, data)
    return path


def write_joints(path: Path, topics: dict[str, list[list[str]]]) -> Path:
    """Writes joint states whose messages name, in turn, the joints of the lists of each topic."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    kind = "sensor_msgs/msg/JointState"
    stamp = store.types["builtin_interfaces/msg/Time"](0, 0)
    header = store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="")
    with rosbag2.Writer(path, version=9) as writer:
        for topic, names in topics.items():
            connection = writer.add_connection(topic, kind, typestore=store)
            for k in range(2 * N_SAMPLES):
                own = names[k % len(names)]
                message = store.types[kind](
                    header=header,
                    name=own,
                    position=np.array([k + len(name) for name in own], float),
                    velocity=np.zeros(0),
                    effort=np.zeros(0),
                )
                writer.write(connection, k * 10**7, store.serialize_cdr(message, kind))
    return path


def write_c3d(path: Path, position: np.ndarray, labels: list[str], unit: str = "mm") -> Path:
    """Writes markers (T, 3 N) by ezc3d."""
    ezc3d = pytest.importorskip("ezc3d")
    file = ezc3d.c3d()
    point = file["parameters"]["POINT"]
    point["RATE"]["value"], point["LABELS"]["value"] = [RATE], labels
    point["UNITS"]["value"] = [unit]
    points = np.ones((4, len(labels), len(position)))
    points[:3] = position.reshape(len(position), len(labels), 3).transpose(2, 1, 0)
    file["data"]["points"] = points
    file.write(str(path))
    return path


def write_robomimic(path: Path, n_demos: int = 3) -> Path:
    """Writes demonstrations in the layout of robomimic, by h5py."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        data = file.create_group("data")
        data.attrs["env_args"] = json.dumps({"type": 1, "env_kwargs": {"control_freq": 20}})
        for k in reversed(range(n_demos)):
            demo = data.create_group(f"demo_{8 + k}")
            demo.attrs["num_samples"], demo.attrs["object"] = N_SAMPLES, f"can {k % 2}"
            demo["obs/robot0_eef_pos"] = path_of(k)
            demo["obs/robot0_eef_quat"] = quaternions()
            demo["obs/robot0_joint_pos"] = path_of(k, 7)
            demo["actions"] = path_of(k, 7)
    return path
