"""Kinematics of frames of robots in MuJoCo and Pinocchio."""

import importlib
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pdmp
from pdmp.robots import Kinematics, MujocoKinematics, PinocchioKinematics
from reproduction.baxter import engine

# Imported with a renderer for the tests that need one: the first import chooses it.
mujoco = engine()
needs_pinocchio = pytest.mark.skipif(find_spec("pinocchio") is None, reason="pin not installed")

LINK = """<link name="{name}"><inertial><mass value="1"/>
  <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>"""
JOINT = """<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
  <origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>
  <limit lower="-3" upper="3" velocity="1" effort="1"/>{more}</joint>"""


def chain(more: str = "") -> str:
    """Returns a URDF file of a chain of four joints, and a finger beside its last link."""
    joints = [
        ("slide", "prismatic", "base", "a", "0.1 0.2 0.3", "0.3 -0.2 0.9", "0 1 0", ""),
        ("turn", "continuous", "a", "b", "0 0.3 -0.1", "1.1 0.2 -0.4", "0 0 1", ""),
        ("bend", "revolute", "b", "c", "0.4 0 0.2", "-0.7 0.5 2.0", "0.6 0 0.8", ""),
        ("twist", "revolute", "c", "d", "0.1 -0.3 0", "0 1.2 0.3", "1 0 0", more),
        ("finger", "prismatic", "d", "e", "0 0.02 0.1", "0 0 0", "0 1 0", ""),
    ]
    keys = ("name", "kind", "parent", "child", "xyz", "rpy", "axis", "more")
    described = "".join(JOINT.format(**dict(zip(keys, joint, strict=True))) for joint in joints)
    links = "".join(LINK.format(name=name) for name in ("base", *"abcde"))
    return f'<?xml version="1.0"?><robot name="chain">{links}{described}</robot>'


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    """Returns the path of the file of the chain."""
    path = tmp_path / "chain.urdf"
    path.write_text(chain(), encoding="utf-8")
    return path


MJCF = """<mujoco><compiler angle="radian"/><worldbody>
  <body name="torso"><freejoint name="root"/><geom size="1"/>
    <body name="thigh" pos="0 0 -1"><joint name="hip" type="ball"/><geom size="1"/>
      <body name="shank" pos="0 0 -1"><joint name="knee" axis="0 1 0" ref="0.5"/><geom size="1"/>
        <site name="toe" pos="0.3 0.1 0" euler="0.3 0.5 0.7"/>
        <body name="twin"><joint name="twin"/><geom size="1"/></body>
      </body>
    </body>
  </body></worldbody>
  <equality><joint joint1="twin" joint2="knee"/></equality>
</mujoco>"""


def rotation(quaternion: np.ndarray) -> np.ndarray:
    """Returns the matrix (3, 3) of a unit quaternion."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def arms(urdf: Path) -> dict[str, Any]:
    """Returns kinematics of the last link of the chain, by the name of the library."""
    found: dict[str, Any] = {"mujoco": MujocoKinematics(urdf, body="d")}
    if find_spec("pinocchio"):
        found["pinocchio"] = PinocchioKinematics(urdf, "d")
    return found


@pytest.mark.parametrize("library", ["mujoco", pytest.param("pinocchio", marks=needs_pinocchio)])
def test_jacobian_is_the_derivative_of_the_pose(library: str, urdf: Path) -> None:
    """Central differences: the velocity of the origin, and Rᵀ dR/dt of the body frame."""
    arm, random, step = arms(urdf)[library], np.random.default_rng(0), 1e-6
    for _ in range(50):
        position, velocity = random.uniform(-3, 3, 4), random.normal(size=4)
        before, now, after = arm.forward(position + step * np.outer([-1, 0, 1], velocity))
        linear = (after[:3] - before[:3]) / (2 * step)
        spin = rotation(now[3:]).T @ (rotation(after[3:]) - rotation(before[3:])) / (2 * step)
        moved = arm.jacobian(position) @ velocity
        np.testing.assert_allclose(moved[:3], linear, atol=1e-8)
        np.testing.assert_allclose(moved[3:], [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-8)


@needs_pinocchio
def test_both_libraries_agree_on_one_description(urdf: Path) -> None:
    """Poses and Jacobians of one file are the same to rounding, in any order of the joints."""
    random = np.random.default_rng(1)
    for joints in (None, ["twist", "slide", "bend", "turn"], ["bend", "finger"]):
        mine = MujocoKinematics(urdf, body="d", joints=joints)
        other = PinocchioKinematics(urdf, "d", joints=joints)
        assert mine.joints == other.joints
        for position in random.uniform(-3, 3, (20, len(mine.joints))):
            pose, expected = mine.forward(position), other.forward(position)
            np.testing.assert_allclose(pose[:3], expected[:3], atol=1e-14)
            assert abs(abs(pose[3:] @ expected[3:]) - 1) < 1e-14
            np.testing.assert_allclose(
                mine.jacobian(position), other.jacobian(position), atol=1e-14
            )


def test_joints_are_those_of_the_way_to_the_frame(urdf: Path) -> None:
    """By default the finger beside the link does not belong to its joints."""
    for arm in arms(urdf).values():
        assert arm.joints == ("slide", "turn", "bend", "twist")
        assert isinstance(arm, Kinematics)
    joints = ["finger", "turn"]
    arm = MujocoKinematics(urdf, body="d", joints=joints)
    assert arm.joints == ("finger", "turn")
    np.testing.assert_array_equal(arm.jacobian([0.1, 0.2])[:, 0], np.zeros(6))


def test_rows_of_positions_give_rows_of_poses(urdf: Path) -> None:
    """A recording of joint positions is converted at once."""
    positions = np.random.default_rng(2).uniform(-3, 3, (2, 5, 4))
    for arm in arms(urdf).values():
        poses = arm.forward(positions)
        assert poses.shape == (2, 5, 7) and arm.forward(positions[:, :0]).shape == (2, 0, 7)
        np.testing.assert_array_equal(poses[1, 3], arm.forward(positions[1, 3]))
        np.testing.assert_allclose(np.linalg.norm(poses[..., 3:], axis=-1), 1, atol=1e-15)


def test_joints_that_do_not_move_keep_their_configuration(urdf: Path) -> None:
    """Poses of some joints are those of all with the others at the configuration."""
    others = np.array([0.4, 0.0, -0.8, 0.0, 0.01])
    whole = MujocoKinematics(urdf, body="d")
    arm = MujocoKinematics(urdf, body="d", joints=["turn", "twist"], configuration=others)
    pose = whole.forward([0.4, 1.3, -0.8, 0.7])
    np.testing.assert_array_equal(arm.forward([1.3, 0.7]), pose)
    jacobian = whole.jacobian([0.4, 1.3, -0.8, 0.7])[:, [1, 3]]
    np.testing.assert_array_equal(arm.jacobian([1.3, 0.7]), jacobian)
    if find_spec("pinocchio"):
        # The continuous joint has two coordinates, cosine and sine.
        others = np.array([0.4, 1.0, 0.0, -0.8, 0.0, 0.01])
        other = PinocchioKinematics(
            urdf, "d", joints=["turn", "twist"], configuration=others
        ).forward([1.3, 0.7])
        np.testing.assert_allclose(other[:3], pose[:3], atol=1e-14)


def test_sites_move_with_their_body() -> None:
    """The pose of a site is its pose in the body, carried by free, ball and hinge joints."""
    model = mujoco.MjModel.from_xml_string(MJCF)
    configuration = model.qpos0.copy()
    configuration[:3] = 1, 2, 3
    toe = MujocoKinematics(model, site="toe", configuration=configuration)
    shank = MujocoKinematics(model, body="shank", configuration=configuration)
    assert toe.joints == ("knee",)
    pose, carrier = toe.forward([0.9]), shank.forward([0.9])
    # The angle 0.5 is that of the drawn robot.
    turned = [[np.cos(0.4), 0, np.sin(0.4)], [0, 1, 0], [-np.sin(0.4), 0, np.cos(0.4)]]
    np.testing.assert_allclose(rotation(carrier[3:]), turned, atol=1e-15)
    np.testing.assert_allclose(carrier[:3], [1, 2, 1], atol=1e-15)
    np.testing.assert_allclose(pose[:3], carrier[:3] + turned @ np.array([0.3, 0.1, 0]), atol=1e-15)
    about = rotation(model.site_quat[0]).T @ [0, 1, 0]
    np.testing.assert_allclose(toe.jacobian([0.9])[3:, 0], about, atol=1e-15)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "body = None, site = None: name the frame by one of both"),
        ({"body": "shank", "site": "toe"}, "body = 'shank', site = 'toe': name the frame by one"),
        ({"body": "toe"}, "model: no body 'toe'; to choose from: world, torso, thigh, shank"),
        ({"site": "shank"}, "model: no site 'shank'; to choose from: toe"),
        ({"body": "thigh"}, "model: no hinge or slide moves the body 'thigh'"),
        ({"body": "twin"}, "model: joint 'twin' on the way to the body 'twin' follows an equality"),
        ({"site": "toe", "joints": ["root"]}, "model: joint 'root' is free or a ball joint"),
        ({"site": "toe", "joints": ["toe"]}, "model: no joint 'toe'; joints to choose from: knee"),
        ({"site": "toe", "configuration": [0.0]}, "configuration has shape [1]: expected the 13"),
        ({"site": "toe", "configuration": ["a"]}, "configuration = ['a']: expected the 13 finite"),
        ({"site": "toe", "configuration": [np.nan] * 13}, "configuration = [nan, nan, nan, nan"),
    ],
)
def test_bad_frames_and_joints_of_mujoco_are_refused(
    arguments: dict[str, Any], message: str
) -> None:
    """The error names the argument and lists the names to choose from."""
    with pytest.raises(ValueError) as caught:
        MujocoKinematics(mujoco.MjModel.from_xml_string(MJCF), **arguments)
    assert str(caught.value).startswith(message)


@needs_pinocchio
@pytest.mark.parametrize(
    ("frame", "arguments", "message"),
    [
        ("hand", {}, "no frame 'hand'; to choose from: base, slide, a, turn, b, bend, c, twist"),
        ("base", {}, "no joint with one degree of freedom moves the frame 'base'"),
        ("d", {"joints": ["elbow"]}, "no joint 'elbow'; joints to choose from: slide, turn, bend"),
        ("d", {"joints": ["turn", "turn"]}, "joints has 'turn' twice"),
    ],
)
def test_bad_frames_and_joints_of_pinocchio_are_refused(
    frame: str, arguments: dict[str, Any], message: str, urdf: Path
) -> None:
    """The error names the argument and lists the names to choose from."""
    with pytest.raises(ValueError) as caught:
        PinocchioKinematics(urdf, frame, **arguments)
    assert str(caught.value).removeprefix(f"{urdf}: ").startswith(message)


@needs_pinocchio
def test_joints_of_pinocchio_with_other_degrees_of_freedom_are_refused(tmp_path: Path) -> None:
    """A free joint stays at its configuration, and a mimicking joint is refused."""
    pinocchio = importlib.import_module("pinocchio")
    text = chain('<mimic joint="bend" multiplier="2"/>')
    free = pinocchio.buildModelFromXML(text, pinocchio.JointModelFreeFlyer())
    assert PinocchioKinematics(free, "d").joints == ("slide", "turn", "bend", "twist")
    with pytest.raises(ValueError, match="joint 'root_joint' has several degrees of freedom"):
        PinocchioKinematics(free, "d", joints=["root_joint"])
    mimicking = pinocchio.buildModelFromXML(text, mimic=True)
    with pytest.raises(ValueError, match="joint 'twist' on the way to the frame 'd' mimics"):
        PinocchioKinematics(mimicking, "d")


@pytest.mark.parametrize(
    ("position", "message"),
    [
        (
            [1, 2, 3],
            "position has shape [3]: expected a position for each of 4 joints (slide, turn",
        ),
        (1.0, "position has shape []: expected a position for each of 4 joints"),
        (["a"], "position = ['a']: expected a position for each of 4 joints"),
        ([0, 1, np.nan, 2], "position[2] = nan of 'bend': expected a finite number"),
    ],
)
def test_positions_of_other_joints_are_refused(position: Any, message: str, urdf: Path) -> None:
    """The error names the joints, and no pose has NaN."""
    for arm in arms(urdf).values():
        for method in (arm.forward, arm.jacobian):
            with pytest.raises(ValueError) as caught:
                method(position)
            assert str(caught.value).startswith(message)
        with pytest.raises(ValueError, match=r"position has shape \[2, 4\]"):
            arm.jacobian(np.zeros((2, 4)))


def test_missing_packages_are_named(monkeypatch: pytest.MonkeyPatch, urdf: Path) -> None:
    """Without the package, the error names it; `pdmp.robots` itself needs neither."""
    monkeypatch.setitem(sys.modules, "mujoco", None)
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    with pytest.raises(ImportError, match="pip install mujoco"):
        MujocoKinematics(urdf, body="d")
    with pytest.raises(ImportError, match="pip install pin"):
        PinocchioKinematics(urdf, "d")


@needs_pinocchio
def test_files_and_models_are_read_alike_by_pinocchio(urdf: Path, tmp_path: Path) -> None:
    """A model serves as its file; what is neither is refused."""
    pinocchio = importlib.import_module("pinocchio")
    model = pinocchio.buildModelFromUrdf(str(urdf))
    position = [0.1, 0.2, 0.3, 0.4]
    poses = [PinocchioKinematics(source, "d").forward(position) for source in (urdf, model)]
    np.testing.assert_array_equal(*poses)
    bad = tmp_path / "bad.urdf"
    bad.write_text("hello", encoding="utf-8")
    with pytest.raises(ValueError, match="not read by Pinocchio"):
        PinocchioKinematics(bad, "d")
    with pytest.raises(FileNotFoundError, match="absent"):
        PinocchioKinematics(tmp_path / "absent.urdf", "d")
    with pytest.raises(TypeError, match=r"model = 3: expected a path or a pinocchio\.Model"):
        PinocchioKinematics(3, "d")  # type: ignore[arg-type]


def test_jacobian_gives_the_velocities_of_a_primitive_of_poses(urdf: Path) -> None:
    """Its rows are the degrees of freedom of a primitive that is fitted to poses."""
    s = np.linspace(0, 1, 201)[:, None]
    shares = [s**3 * (10 - 15 * s + 6 * s**2), 30 * s**2 * (1 - s) ** 2]
    offset, span = np.array([0.1, -2.0, 0.5, 1.0]), np.array([0.3, 2.5, -1.5, 2.0])
    dt, arm = 0.01, MujocoKinematics(urdf, body="d")
    joints, rates = offset + span * shares[0], span * shares[1] / (200 * dt)
    demo = pdmp.Demonstration(arm.forward(joints), dt=dt, rotations={3: "wxyz"})
    moves = pdmp.fit([demo], smoothing=None).rollout(dt=dt)
    expected = np.array([arm.jacobian(q) @ v for q, v in zip(joints, rates, strict=True)])
    assert np.abs(expected[:, 3:]).max() > 2
    np.testing.assert_allclose(moves.velocity, expected, atol=2e-3)
