"""Movements that are written are read back: Parquet, ROS bags and LeRobot data sets."""

import json
from pathlib import Path

import numpy as np
import pandas
import pytest

import pdmp
import recorded
from synthetic import reaches


@pytest.fixture(scope="module")
def model() -> pdmp.Model:
    """Returns a model of reaches with names and units."""
    demos = [
        pdmp.Demonstration(demo.position, dt=demo.dt, names=["x", "y"], units=["m", "m"])
        for demo in reaches()
    ]
    return pdmp.fit(demos, n_styles=2)


def test_a_trajectory_is_a_bag(tmp_path: Path, model: pdmp.Model) -> None:
    """Positions are read back bit for bit, times to a nanosecond."""
    trajectory = model.rollout(dt=0.01)
    pdmp.io.write_rosbag(tmp_path / "out", trajectory, topic="/arm", names=["a", "b"])
    assert sorted(each.name for each in (tmp_path / "out").iterdir()) == [
        "metadata.yaml",
        "out.mcap",
    ]
    demos = pdmp.io.read_rosbag(tmp_path / "out")
    demo = demos["/arm/0"]
    np.testing.assert_array_equal(demo.position, trajectory.position)
    np.testing.assert_allclose(demo.time, trajectory.time, atol=1e-9)
    assert demo.names == ["a", "b"]


def test_bags_are_not_overwritten(tmp_path: Path, model: pdmp.Model) -> None:
    """An error leaves nothing behind."""
    trajectory = model.rollout(dt=0.01)
    with pytest.raises(FileExistsError, match="exists; name a new folder"):
        pdmp.io.write_rosbag(tmp_path, trajectory)
    with pytest.raises(FileNotFoundError, match="no such folder"):
        pdmp.io.write_rosbag(tmp_path / "a" / "b", trajectory)
    with pytest.raises(ValueError, match="names has length 1, expected 2"):
        pdmp.io.write_rosbag(tmp_path / "out", trajectory, names=["a"])
    assert not list(tmp_path.iterdir())


def test_movements_are_episodes(tmp_path: Path, model: pdmp.Model) -> None:
    """New styles and goals are read back in single precision, with their tasks."""
    goals = [[0.9, 0.1], [1.1, -0.1], [1.0, 0.2]]
    movements = [model.rollout(goal=goal, dt=1 / 50) for goal in goals]
    tasks = ["reach left", "reach right", "reach left"]
    pdmp.io.write_lerobot(tmp_path / "set", movements, tasks=tasks, robot="planar")
    demos = pdmp.io.read_lerobot(tmp_path / "set", context=["task"])
    for demo, movement, task in zip(demos.values(), movements, tasks, strict=True):
        np.testing.assert_array_equal(demo.position, movement.position.astype("f4"))
        assert (demo.names, demo.dt, demo.context) == (["x", "y"], 1 / 50, [task])
    actions = pdmp.io.read_lerobot(tmp_path / "set", features="action")["1"]
    np.testing.assert_array_equal(actions.position[:-1], demos["1"].position[1:])


def test_a_data_set_has_the_tables_of_lerobot(tmp_path: Path, model: pdmp.Model) -> None:
    """Indices, tasks and statistics are consistent, as lerobot reads them with pandas."""
    movements = {name: model.rollout(tau=tau, dt=0.02) for name, tau in (("a", 0.5), ("b", 0.8))}
    pdmp.io.write_lerobot(tmp_path / "set", movements, tasks=["one", "two"])
    meta = tmp_path / "set" / "meta"
    info = json.loads((meta / "info.json").read_text())
    frames = pandas.read_parquet(
        tmp_path / "set" / info["data_path"].format(chunk_index=0, file_index=0)
    )
    assert set(frames.columns) == set(info["features"])
    episodes = pandas.read_parquet(meta / "episodes" / "chunk-000" / "file-000.parquet")
    tasks = pandas.read_parquet(meta / "tasks.parquet")
    assert tasks.index.tolist() == ["one", "two"] and tasks["task_index"].tolist() == [0, 1]
    assert frames["index"].tolist() == list(range(info["total_frames"]))
    for row in episodes.itertuples():
        own = frames[frames["episode_index"] == row.episode_index]
        assert own["index"].tolist() == list(range(row.dataset_from_index, row.dataset_to_index))
        assert len(own) == row.length and list(row.tasks) == [
            tasks.index[own["task_index"].iloc[0]]
        ]
        np.testing.assert_allclose(own["timestamp"], np.arange(row.length) / info["fps"], rtol=1e-6)
    stats = json.loads((meta / "stats.json").read_text())
    states = np.stack(frames["observation.state"])
    np.testing.assert_allclose(stats["observation.state"]["mean"], states.mean(0), atol=1e-6)
    np.testing.assert_allclose(stats["action"]["max"], np.stack(frames["action"]).max(0))


def test_movements_that_form_no_data_set_are_refused(tmp_path: Path, model: pdmp.Model) -> None:
    """The error names the movement and the remedy, and nothing is written."""
    movement = model.rollout(dt=0.02)
    for movements, tasks, message in [
        ([], "a", "movements is empty"),
        ([movement], ["a", "b"], "tasks has length 2, expected 1"),
        ([model.rollout(dt=0.0137)], "a", r"movements\[0\] has intervals of 0.0137"),
        ([movement, model.rollout(dt=0.01)], "a", "have 50 and 100 frames per second"),
        ([movement, pdmp.Demonstration(recorded.path_of(0), dt=0.02)], "a", "different degrees"),
        ([pdmp.Demonstration(recorded.path_of(0))], "a", r"movements\[0\] has no times"),
    ]:
        with pytest.raises(ValueError, match=message):
            pdmp.io.write_lerobot(tmp_path / "set", movements, tasks=tasks)
    assert not list(tmp_path.iterdir())
