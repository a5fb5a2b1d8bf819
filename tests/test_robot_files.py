"""Recordings of robots are read as they were written: LeRobot, ROS bags and robomimic."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pdmp
import recorded
from recorded import JOINTS, N_SAMPLES, RATE

VERSIONS = pytest.mark.parametrize("version", ["v3.0", "v2.1"])


@VERSIONS
def test_episodes_are_read_in_single_precision_with_names_interval_and_context(
    tmp_path: Path, version: str
) -> None:
    """Both versions give the written positions, exact multiples of 1/fps and the first task."""
    paths = [recorded.path_of(k, n_samples=30 + k) for k in range(4)]
    folder = recorded.write_lerobot(tmp_path / "set", version, paths)
    demos = pdmp.io.read_lerobot(folder, context=["task", "observation.load"])
    assert list(demos) == ["0", "1", "2", "3"]
    for k, demo in enumerate(demos.values()):
        np.testing.assert_array_equal(demo.position, paths[k].astype("f4"))
        assert (demo.names, demo.dt) == (JOINTS, 1 / RATE)
        assert demo.context == [f"task {k % 2}", 0.5 * k]
    assert pdmp.fit(demos, contexts=np.arange(4.0)[:, None]).names == JOINTS


@VERSIONS
def test_episodes_features_and_columns_are_selected(tmp_path: Path, version: str) -> None:
    """Names that two features share have the feature's in front."""
    paths = [recorded.path_of(k) for k in range(4)]
    folder = recorded.write_lerobot(tmp_path / "set", version, paths)
    actions = pdmp.io.read_lerobot(folder, features="action", episodes=[3], columns=["wrist"])
    np.testing.assert_array_equal(actions["3"].position[:, 0], paths[3].astype("f4")[:, 2] + 1)
    both = pdmp.io.read_lerobot(folder, features=["observation.state", "action"])["0"]
    assert both.names[3:] == [f"action.{name}" for name in JOINTS]
    assert len(pdmp.io.read([folder])) == 4


def test_a_data_set_that_does_not_fit_its_metadata_is_refused(tmp_path: Path) -> None:
    """Missing episodes, features and frames, and other versions, are named."""
    paths = [recorded.path_of(k) for k in range(4)]
    folder = recorded.write_lerobot(tmp_path / "set", "v3.0", paths)
    with pytest.raises(ValueError, match="no episode 7 among 4"):
        pdmp.io.read_lerobot(folder, episodes=[7])
    with pytest.raises(ValueError, match="no feature 'x' of numbers among observation.state, act"):
        pdmp.io.read_lerobot(folder, features="x")
    with pytest.raises(ValueError, match="has no meta/info.json"):
        pdmp.io.read_lerobot(tmp_path)
    (folder / "data" / "chunk-000" / "file-001.parquet").unlink()
    with pytest.raises(ValueError, match="episode 2: has 0 frames, but its metadata state 40"):
        pdmp.io.read_lerobot(folder)
    info = folder / "meta" / "info.json"
    info.write_text(info.read_text().replace("v3.0", "v1.6"))
    with pytest.raises(ValueError, match="codebase_version is 'v1.6': expected v3.0 or v2.1"):
        pdmp.io.read_lerobot(folder)


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
def test_joint_states_are_read_by_name_whatever_their_order(tmp_path: Path, storage: str) -> None:
    """Positions follow the names of each message; times are the stamps, from the first."""
    folder = recorded.write_bag(tmp_path / "bag", "sensor_msgs/msg/JointState", storage=storage)
    (demo,) = pdmp.io.read_rosbag(folder).values()
    np.testing.assert_array_equal(demo.position, recorded.path_of(0))
    np.testing.assert_allclose(demo.time, recorded.TIME, atol=1e-12)
    assert demo.names == JOINTS
    (file,) = [each for each in folder.iterdir() if each.suffix != ".yaml"]
    (alone,) = pdmp.io.read([file])
    np.testing.assert_array_equal(alone.position, demo.position)


def test_messages_without_stamps_have_the_times_of_the_recording(tmp_path: Path) -> None:
    """Headers of zeros are replaced by the times at which messages were recorded."""
    folder = recorded.write_bag(tmp_path / "bag", "sensor_msgs/msg/JointState", stamped=False)
    (demo,) = pdmp.io.read([folder])
    np.testing.assert_allclose(demo.time, recorded.TIME, atol=1e-12)


def test_poses_are_rotations(tmp_path: Path) -> None:
    """The quaternion of a pose is declared as a rotation, and is not cut into parts."""
    folder = recorded.write_bag(tmp_path / "bag", "geometry_msgs/msg/PoseStamped")
    (demo,) = pdmp.io.read_rosbag(folder, topic="/arm").values()
    assert (demo.rotations, demo.n_dofs, demo.units[:3]) == ({3: "xyzw"}, 6, ["m"] * 3)
    np.testing.assert_allclose(demo.position[:, 3:], recorded.quaternions(), atol=1e-15)
    (turn,) = pdmp.io.read_rosbag(folder, columns=["qx", "qy", "qz", "qw"]).values()
    assert turn.rotations == {0: "xyzw"}
    (place,) = pdmp.io.read_rosbag(folder, columns=["z"]).values()
    assert not place.rotations
    with pytest.raises(ValueError, match="keep qx, qy, qz, qw, in this order, or none"):
        pdmp.io.read_rosbag(folder, columns=["x", "qw"])


def test_publishers_that_share_a_topic_are_separated_by_their_joints(tmp_path: Path) -> None:
    """Messages without the joints to keep are skipped; without columns, the sets are named."""
    topics = {"/joint_states": [["arm", "elbow"], ["finger"], ["elbow", "arm", "rail"]]}
    folder = recorded.write_joints(tmp_path / "bag", topics)
    with pytest.raises(ValueError, match=r"pass columns= with some of arm, elbow \| finger \| elb"):
        pdmp.io.read_rosbag(folder)
    (demo,) = pdmp.io.read_rosbag(folder, columns=["elbow", "arm"]).values()
    samples = [k for k in range(2 * N_SAMPLES) if k % 3 != 1]
    np.testing.assert_array_equal(demo.position, np.array(samples)[:, None] + [5, 3])
    np.testing.assert_allclose(demo.time, 0.01 * np.array(samples), atol=1e-12)
    (finger,) = pdmp.io.read_rosbag(folder, columns=["finger"]).values()
    assert finger.n_samples == 27
    with pytest.raises(ValueError, match="messages name different joints"):
        pdmp.io.read_rosbag(folder, columns=["arm", "finger"])


def test_a_bag_of_several_topics_needs_the_name_of_one(tmp_path: Path) -> None:
    """The error lists the topics that can be read."""
    folder = recorded.write_joints(tmp_path / "bag", {"/left": [["a"]], "/right": [["b"]]})
    with pytest.raises(ValueError, match="several topics, pass topic= one of /left, /right"):
        pdmp.io.read_rosbag(folder)
    assert pdmp.io.read_rosbag(folder, topic="/right")["/right"].names == ["b"]


def test_each_joint_trajectory_is_a_demonstration(tmp_path: Path) -> None:
    """Points and their times from the start are read from each message."""
    folder = recorded.write_bag(tmp_path / "bag", "trajectory_msgs/msg/JointTrajectory")
    demos = pdmp.io.read_rosbag(folder)
    assert list(demos) == ["/arm/0", "/arm/1"]
    np.testing.assert_array_equal(demos["/arm/1"].position, recorded.path_of(1))
    np.testing.assert_allclose(demos["/arm/1"].time, recorded.TIME, atol=1e-12)


def test_bags_without_the_topic_are_refused(tmp_path: Path) -> None:
    """A missing topic is named beside those that can be read; a missing bag is an OSError."""
    folder = recorded.write_bag(tmp_path / "bag", "geometry_msgs/msg/PoseStamped")
    with pytest.raises(ValueError, match="no topic '/leg' of JointState, .* among /arm"):
        pdmp.io.read_rosbag(folder, topic="/leg")
    with pytest.raises(FileNotFoundError):
        pdmp.io.read_rosbag(tmp_path / "missing.mcap")
    with pytest.raises(ValueError, match="not a ROS bag file, or damaged"):
        pdmp.io.read_rosbag(tmp_path)


def test_demonstrations_of_robomimic_are_poses_by_default(tmp_path: Path) -> None:
    """Position and rotation of the end effector are read at the control frequency."""
    path = recorded.write_robomimic(tmp_path / "demo.hdf5")
    demos = pdmp.io.read_hdf5(path, context=["object"])
    assert list(demos) == ["demo_8", "demo_9", "demo_10"]
    demo = demos["demo_9"]
    assert (demo.dt, demo.rotations, demo.context) == (0.05, {3: "xyzw"}, ["can 1"])
    assert demo.units == ["m"] * 3 + [""] * 4
    np.testing.assert_array_equal(demo.position[:, :3], recorded.path_of(1))
    joints = pdmp.io.read_hdf5(
        path, features="obs/robot0_joint_pos", columns=["robot0_joint_pos.6"]
    )
    np.testing.assert_array_equal(joints["demo_8"].position[:, 0], recorded.path_of(0, 7)[:, 6])
    with pytest.raises(
        ValueError, match="no data set 'obs/x' .* some of actions, obs/robot0_eef_pos"
    ):
        pdmp.io.read_hdf5(path, features="obs/x")


def test_packages_of_formats_are_imported_when_used() -> None:
    """The readers import none of the packages that read formats before they are called."""
    code = (
        "import sys, pdmp; [getattr(pdmp.io, name) for name in dir(pdmp.io)]; print(sorted({"
        "'pyarrow', 'rosbags', 'h5py', 'scipy', 'ezc3d', 'bvh', 'pandas', 'xarray'} "
        "& sys.modules.keys()))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_a_missing_package_is_named_with_its_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The error of a missing package has the command that installs it."""
    path = recorded.write_robomimic(tmp_path / "demo.hdf5")
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(ImportError, match=r"need the package h5py: pip install 'pdmp\[hdf5\]'"):
        pdmp.io.read_hdf5(path)


def test_metadata_of_any_kind_are_refused(tmp_path: Path) -> None:
    """Descriptions of another structure are errors that name the file."""
    folder = recorded.write_lerobot(tmp_path / "set", "v2.1", [recorded.path_of(0)])
    info = folder / "meta" / "info.json"
    valid = json.loads(info.read_text())
    changes = [
        [],
        {"codebase_version": "v2.1"},
        valid | {"features": []},
        valid | {"features": {"observation.state": {"shape": "x"}}},
        valid | {"features": {"observation.state": {"dtype": "float32", "shape": [2]}}},
    ]
    for changed in changes:
        info.write_text(json.dumps(changed))
        with pytest.raises(ValueError, match="set"):
            pdmp.io.read_lerobot(folder)
    assert N_SAMPLES == 40
