"""Joint limits of robots: published ones, and those of URDF files and MuJoCo models."""

import math
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pdmp
from pdmp import Limits
from pdmp.robots import REGISTRY
from reproduction.baxter import engine

ARM = """<?xml version="1.0"?>
<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <link name="base"/><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
  <joint name="slide" type="prismatic">
    <parent link="base"/><child link="a"/><axis xyz="1 0 0"/>
    <limit lower="-0.2" upper="0.5" velocity="0.3" effort="1"/>
    <safety_controller soft_lower_limit="-0.1" soft_upper_limit="0.4" k_velocity="1"/>
  </joint>
  <joint name="flange" type="fixed"><parent link="a"/><child link="b"/></joint>
  <joint name="turn" type="continuous">
    <parent link="b"/><child link="c"/><axis xyz="0 0 1"/><limit velocity="3" effort="1"/>
  </joint>
  <joint name="bend" type="revolute">
    <parent link="c"/><child link="d"/>
    <limit upper="2.5" velocity="2" effort="1" acceleration="9" deceleration="7"/>
  </joint>
  <joint name="finger" type="prismatic">
    <parent link="d"/><child link="e"/><limit lower="0" upper="0.04" velocity="1" effort="1"/>
    <mimic joint="slide" multiplier="-1"/>
  </joint>
  <joint name="body" type="floating"><parent link="e"/><child link="f"/></joint>
  <transmission name="t"><joint name="slide"><limit lower="8" upper="9"/></joint></transmission>
</robot>
"""
MJCF = """<mujoco><compiler angle="{angle}"/><worldbody>
  <body><freejoint name="root"/><geom size="1"/>
    <body><joint name="hip" type="ball"/><geom size="1"/></body>
    <body><joint name="knee" range="{lower} {upper}"/><geom size="1"/>
      <body><joint name="toe" type="slide" range="-0.5 0.25"/><geom size="1"/></body>
      <body><joint name="wheel" limited="false" range="{lower} {upper}"/><geom size="1"/></body>
      <body><joint name="twin" range="{lower} {upper}"/><geom size="1"/></body>
    </body>
  </body></worldbody>
  <equality><joint joint1="twin" joint2="knee"/></equality>
</mujoco>"""
# Imported with a renderer for the tests that need one: the first import chooses it.
mujoco = engine()
ROBOSUITE = find_spec("robosuite")
needs_models = pytest.mark.skipif(ROBOSUITE is None, reason="models of robosuite not installed")


def written(folder: Path, text: str, name: str = "robot.urdf") -> Path:
    """Returns the path of a file with a text."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def one_joint(limit: str, kind: str = "revolute") -> str:
    """Returns a description with one joint."""
    return f"<robot name='r'><joint name='elbow' type='{kind}'>{limit}</joint></robot>"


def model_file(*parts: str) -> Path:
    """Returns the path of a robot's description in the wheel of robosuite."""
    assert ROBOSUITE is not None and ROBOSUITE.origin is not None
    return Path(ROBOSUITE.origin).parent.joinpath("models", "assets", *parts)


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    """A description with joints of all kinds."""
    return written(tmp_path, ARM)


# Published limits


@pytest.mark.parametrize("name", REGISTRY)
def test_published_limits_are_complete_and_have_a_source(name: str) -> None:
    """Each list has one positive number for each joint, and the source can be looked up."""
    robot = REGISTRY[name]
    n_dofs = len(robot.joints)
    assert robot.name == name and len(set(robot.joints)) == n_dofs
    assert robot.units == ("rad",) * n_dofs
    assert len(robot.lower) == len(robot.upper) == n_dofs
    assert all(low < high for low, high in zip(robot.lower, robot.upper, strict=True))
    for column in (robot.velocity, robot.acceleration, robot.jerk):
        assert column is None or (len(column) == n_dofs and min(column) > 0)
    assert robot.url.startswith("https://") and " @ " in robot.source
    assert len(robot.date.split("-")) == 3 and robot.contents and robot.note
    if robot.acceleration is None or robot.jerk is None:
        assert "not published" in robot.note


@pytest.mark.parametrize("name", REGISTRY)
def test_published_limits_become_limits(name: str) -> None:
    """The limits hold the numbers of the table; what is not published is no limit."""
    robot, limits = REGISTRY[name], REGISTRY[name].limits()
    np.testing.assert_array_equal(limits.position, (robot.lower, robot.upper))
    for column, limit in (
        (robot.velocity, limits.velocity),
        (robot.acceleration, limits.acceleration),
        (robot.jerk, limits.jerk),
    ):
        if column is None:
            assert limit is None
        else:
            np.testing.assert_array_equal(limit, column)


def test_bounds_complete_and_tighten_published_limits_but_never_widen_them() -> None:
    """Of two bounds the smaller holds, joint by joint."""
    velocity = [1.0, 3.0, 2.175, 9.0, 2.0, math.inf, 0.5]
    limits = REGISTRY["panda"].limits(velocity=velocity, acceleration=12.0)
    np.testing.assert_array_equal(limits.velocity, [1, 2.175, 2.175, 2.175, 2, 2.61, 0.5])
    np.testing.assert_array_equal(limits.acceleration, [12, 7.5, 10, 12, 12, 12, 12])
    np.testing.assert_array_equal(REGISTRY["ur5e"].limits(acceleration=4).acceleration, [4.0] * 6)


def test_joints_select_and_order_published_limits() -> None:
    """Limits are those of the joints in the order asked for."""
    limits = REGISTRY["baxter"].limits(["w0", "s1"], acceleration=[5.0, 6.0])
    np.testing.assert_array_equal(limits.position, [[-3.059, -2.147], [3.059, 1.047]])
    np.testing.assert_array_equal(limits.velocity, [4.0, 1.5])
    np.testing.assert_array_equal(limits.acceleration, [5.0, 6.0])
    with pytest.raises(ValueError, match="baxter: no joint 'left_s0'; joints to choose from: s0, "):
        REGISTRY["baxter"].limits(["left_s0"])


def test_braking_inside_the_limits_of_fr3_respects_its_velocity_near_the_ends() -> None:
    """States from which a joint stops in its range are inside the robot's own velocity limits.

    Those fall towards the ends of the full range: -offset + √(2·deceleration·distance).
    """
    end = np.array([2.9007, 1.8361, 2.9007, -0.1169, 2.8763, 4.6216, 3.0508])
    start = np.array([-2.9007, -1.8361, -2.9007, -3.0770, -2.8763, 0.4398, -3.0508])
    offset = np.array([0.6599, 0.2517, 0.2000, 0.3533, 0.5757, 0.4878, 0.4628])
    deceleration = np.array([6.0, 2.585, 3.5, 4.0, 17.0, 5.5, 17.0])
    robot = REGISTRY["fr3"]
    velocity, acceleration = np.array(robot.velocity), np.array(robot.acceleration)
    for distance in np.linspace(0.0, 0.5, 501):
        fastest = np.minimum(velocity, np.sqrt(2 * acceleration * distance))
        for margin in (end - np.array(robot.upper), np.array(robot.lower) - start):
            allowed = -offset + np.sqrt(2 * deceleration * (margin + distance))
            assert (fastest <= allowed).all()


@needs_models
def test_published_limits_are_those_of_other_descriptions() -> None:
    """Independent descriptions of the robots have the same numbers."""
    panda = model_file("bullet_data", "panda_description", "urdf", "panda_arm.urdf")
    limits = Limits.from_urdf(panda)
    np.testing.assert_array_equal(limits.position, REGISTRY["panda"].limits().position)
    np.testing.assert_array_equal(limits.velocity, REGISTRY["panda"].limits().velocity)
    baxter = model_file("bullet_data", "baxter_description", "urdf", "baxter_arm.urdf")
    for side in ("left", "right"):
        limits = Limits.from_urdf(baxter, [f"{side}_{name}" for name in REGISTRY["baxter"].joints])
        np.testing.assert_array_equal(limits.position, REGISTRY["baxter"].limits().position)
        np.testing.assert_array_equal(limits.velocity, REGISTRY["baxter"].limits().velocity)
    for name, joints in (
        ("panda", [f"joint{k}" for k in range(1, 8)]),
        ("ur5e", REGISTRY["ur5e"].joints),
        ("baxter", [f"right_{name}" for name in REGISTRY["baxter"].joints]),
    ):
        limits = Limits.from_mujoco(model_file("robots", name, "robot.xml"), joints)
        np.testing.assert_allclose(limits.position, REGISTRY[name].limits().position, atol=5e-6)
        assert limits.velocity is None and limits.acceleration is None


def test_robots_are_imported_at_their_first_use() -> None:
    """A control loop does not pay for the tables; they need no package but numpy."""
    code = (
        "import sys, pdmp; pdmp.Limits.from_urdf, pdmp.Limits.from_mujoco; "
        "assert 'pdmp.robots' not in sys.modules; pdmp.robots.REGISTRY; "
        "assert not {'mujoco', 'scipy', 'matplotlib'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


# URDF


def test_urdf_has_the_movable_joints_in_the_order_of_the_file(arm: Path) -> None:
    """Fixed, mimicking and floating joints are left out; a continuous joint has no range."""
    limits = Limits.from_urdf(arm)
    np.testing.assert_array_equal(limits.position, [[-0.2, -math.inf, 0], [0.5, math.inf, 2.5]])
    np.testing.assert_array_equal(limits.velocity, [0.3, 3, 2])
    np.testing.assert_array_equal(limits.acceleration, [math.inf, math.inf, 7])


def test_joints_select_and_order_those_of_urdf(arm: Path) -> None:
    """Limits follow the names, and bounds follow the limits."""
    limits = Limits.from_urdf(str(arm), ("bend", "slide"), velocity=[0.5, 4], acceleration=6)
    np.testing.assert_array_equal(limits.position, [[0, -0.2], [2.5, 0.5]])
    np.testing.assert_array_equal(limits.velocity, [0.5, 0.3])
    np.testing.assert_array_equal(limits.acceleration, [6, 6])
    free = Limits.from_urdf(arm, ["turn"])
    assert free.position is None and free.acceleration is None


def test_velocity_of_zero_is_unknown_and_asked_for(tmp_path: Path) -> None:
    """Exporters write 0 for an unknown velocity; a given one takes its place."""
    path = written(tmp_path, one_joint("<limit lower='-1' upper='1' velocity='0' effort='0'/>"))
    with pytest.raises(ValueError, match=r"joint 'elbow': velocity = 0: pass velocity=, as"):
        Limits.from_urdf(path)
    np.testing.assert_array_equal(Limits.from_urdf(path, velocity=2).velocity, [2])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "not URDF, or damaged: no element found"),
        ("<robot><joint name='a' type='fixed'>", "not URDF, or damaged"),
        ("<?xml version='1.0' encoding='klingon'?><robot/>", "not URDF, or damaged"),
        ("<mujoco/>", "starts with <mujoco> instead of <robot>: use Limits.from_mujoco"),
        ("<sdf/>", "starts with <sdf> instead of <robot>"),
        ("<robot/>", "has no joint that can be moved"),
        ("<robot><joint type='fixed'/></robot>", "joint 1 has no name: add one"),
        (
            "<robot><joint name='a' type='fixed'/><joint name='a' type='fixed'/></robot>",
            "two joints have the name 'a'",
        ),
        (one_joint("", "hinge"), "joint 'elbow': type = 'hinge': expected one of continuous, "),
        (one_joint(""), "joint 'elbow': a revolute joint without limits: add <limit lower="),
        (one_joint("<limit velocity='1'/>", "prismatic"), "a prismatic joint without limits"),
        (one_joint("<limit lower='1' upper='-1'/>"), "lower = 1.0 is not below upper = -1.0"),
        (one_joint("<limit lower='0' upper='0'/>"), "lower = 0.0 is not below upper = 0.0"),
        (one_joint("<limit lower='nan' upper='1'/>"), "lower = 'nan' is not a number"),
        (one_joint("<limit lower='a' upper='1'/>"), "lower = 'a' is not a number: correct it"),
        (
            one_joint("<limit lower='${-pi}' upper='1'/>"),
            "a number: expand the file with xacro",
        ),
        (one_joint("<limit upper='1' velocity='-2'/>"), "velocity = -2: correct it"),
        (one_joint("<limit upper='1' acceleration='0'/>"), "acceleration = 0: pass acceleration="),
        (
            "<robot xmlns:xacro='http://www.ros.org/wiki/xacro'><xacro:macro name='m'/></robot>",
            "a xacro file: expand it first",
        ),
    ],
)
def test_bad_urdf_is_refused_with_the_file_the_joint_and_the_fix(
    text: str, message: str, tmp_path: Path
) -> None:
    """Each fault has an error that names file, joint and fix."""
    path = written(tmp_path, text)
    with pytest.raises(ValueError) as caught:
        Limits.from_urdf(path)
    assert str(caught.value).startswith(str(path))
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("joints", "error", "message"),
    [
        ("bend", ValueError, r"pass a list of names, \['bend'\]"),
        ([1], TypeError, "joints = .*expected a list of names"),
        ([], ValueError, "joints is empty"),
        (["bend", "bend"], ValueError, "joints has 'bend' twice"),
        (["Bend"], ValueError, "no joint 'Bend'; joints to choose from: slide, turn, bend$"),
        (["flange"], ValueError, "joint 'flange' is fixed; joints to choose from"),
        (["body"], ValueError, "joint 'body' is floating"),
        (["finger"], ValueError, "joint 'finger' mimics 'slide', whose limits hold"),
    ],
)
def test_joints_that_cannot_be_moved_are_refused(
    joints: Any, error: type[Exception], message: str, arm: Path
) -> None:
    """The error says why and lists the joints to choose from."""
    with pytest.raises(error, match=message):
        Limits.from_urdf(arm, joints)


@pytest.mark.parametrize(
    ("bound", "message"),
    [
        (0, "= 0.0 for 'slide': expected a positive number"),
        ([1, 2, math.nan], "= nan for 'bend': expected a positive number"),
        ([1, -2, 3], "= -2.0 for 'turn'"),
        ([1, 2], r"has shape \[2\]: expected one number or 3, one for each joint \(slide, turn"),
        ("fast", "= 'fast': expected one number or 3"),
    ],
)
@pytest.mark.parametrize("argument", ["velocity", "acceleration", "jerk"])
def test_bounds_that_bound_nothing_are_refused(
    argument: str, bound: Any, message: str, arm: Path
) -> None:
    """The error names argument, joint and number."""
    with pytest.raises(ValueError, match=f"^{argument} {message}"):
        Limits.from_urdf(arm, **{argument: bound})


def test_entities_are_refused_before_they_grow(tmp_path: Path) -> None:
    """A declaration of nested entities, or of a file outside, is not followed."""
    nested = "".join(f"<!ENTITY e{k} '{f'&e{k - 1};' * 10 if k else 'x'}'>" for k in range(30))
    outside = "<!ENTITY e29 SYSTEM 'file:///etc/hostname'>"
    for declarations in (nested, outside):
        path = written(tmp_path, f"<!DOCTYPE robot [{declarations}]><robot>&e29;</robot>")
        with pytest.raises(ValueError, match="has a document type declaration, .*: remove it"):
            Limits.from_urdf(path)


def test_files_too_large_for_a_robot_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Reading ends at the largest size."""
    monkeypatch.setattr("pdmp.robots._urdf.MAX_BYTES", 1000)
    path = written(tmp_path, "<robot>" + " " * 1000 + "</robot>")
    with pytest.raises(ValueError, match="more than 1000 bytes, too many for a robot"):
        Limits.from_urdf(path)


def test_nesting_too_deep_for_a_robot_is_refused(tmp_path: Path) -> None:
    """Nested elements are refused before they fill the memory."""
    path = written(tmp_path, "<robot>" + "<gazebo>" * 100_000)
    with pytest.raises(ValueError, match="nested more than 100 deep"):
        Limits.from_urdf(path)


def test_joints_may_come_from_an_iterator(arm: Path) -> None:
    """Names are read once."""
    names = iter(["bend", "turn"])
    np.testing.assert_array_equal(Limits.from_urdf(arm, names).velocity, [2, 3])  # type: ignore[arg-type]


def test_absent_files_are_errors_of_the_system(tmp_path: Path) -> None:
    """A file that cannot be opened has the system's error."""
    for read in (Limits.from_urdf, Limits.from_mujoco):
        with pytest.raises(FileNotFoundError, match="absent"):
            read(tmp_path / "absent.xml")


POSITIVE = st.floats(min_value=1e-9, max_value=1e9)
ROWS = st.tuples(st.floats(allow_nan=False), POSITIVE, POSITIVE).map(
    lambda row: (row[0], row[0] + row[1], row[2])
)
"""Lower and upper limit and velocity of a joint."""


@settings(deadline=None, max_examples=60)
@given(
    rows=st.lists(ROWS.filter(lambda row: row[0] < row[1]), min_size=1, max_size=12),
    data=st.data(),
)
def test_numbers_of_urdf_are_read_exactly_in_any_order(
    rows: list[tuple[float, float, float]], data: st.DataObject
) -> None:
    """A round trip through a file keeps every number, for any selection of the joints."""
    joints = "".join(
        f"<joint name='j{k}' type='revolute'>"
        f"<limit velocity='{v!r}' lower='{low!r}' upper='{high!r}'/></joint>"
        for k, (low, high, v) in enumerate(rows)
    )
    order = data.draw(st.permutations(range(len(rows))))[: data.draw(st.integers(1, len(rows)))]
    with tempfile.TemporaryDirectory() as folder:
        path = written(Path(folder), f"<robot name='r'>{joints}</robot>")
        limits = Limits.from_urdf(path, [f"j{k}" for k in order])
    expected = np.array([rows[k] for k in order]).T
    if np.isfinite(expected[:2]).any():
        np.testing.assert_array_equal(limits.position, expected[:2])
    else:
        assert limits.position is None
    np.testing.assert_array_equal(limits.velocity, expected[2])


def test_damaged_urdf_is_read_or_refused(tmp_path: Path) -> None:
    """Damage to a file ends in an error that names it, or in limits that are limits."""
    rng = np.random.default_rng(0)
    content, path = ARM.encode(), tmp_path / "robot.urdf"
    n_read = n_refused = 0
    for _ in range(1000):
        damaged = bytearray(content)
        for _ in range(rng.integers(1, 4)):
            at, n_lost = rng.integers(len(damaged)), rng.integers(4)
            damaged[at : at + n_lost] = rng.bytes(rng.integers(3))
        path.write_bytes(damaged)
        try:
            limits = Limits.from_urdf(path)
        except ValueError as error:
            assert str(error).startswith(str(path)) and str(error).isprintable()
            n_refused += 1
            continue
        n_read += 1
        if limits.position is not None:
            assert (limits.position[0] < limits.position[1]).all()
        for limit in (limits.velocity, limits.acceleration):
            assert limit is None or (limit > 0).all()
    assert n_read > 50 and n_refused > 500


# MuJoCo


@pytest.mark.parametrize(("angle", "unit"), [("degree", math.pi / 180), ("radian", 1.0)])
def test_mujoco_models_have_rad_whatever_the_unit_of_the_file(
    angle: str, unit: float, tmp_path: Path
) -> None:
    """Ranges of hinges are in rad and of slides in m; unlimited joints have no range."""
    text = MJCF.format(angle=angle, lower=-1.5 / unit, upper=0.75 / unit)
    path = written(tmp_path, text, "robot.xml")
    limits = Limits.from_mujoco(path, acceleration=[3, 4, 5])
    lower, upper = [-1.5, -0.5, -math.inf], [0.75, 0.25, math.inf]
    np.testing.assert_allclose(limits.position, [lower, upper], rtol=1e-12)
    assert limits.velocity is None
    np.testing.assert_array_equal(limits.acceleration, [3, 4, 5])


def test_compiled_models_are_read_like_files(tmp_path: Path) -> None:
    """A model and its file give the same limits, in the order asked for."""
    path = written(tmp_path, MJCF.format(angle="radian", lower=-1, upper=1), "robot.xml")
    model = mujoco.MjModel.from_xml_path(str(path))
    limits = [Limits.from_mujoco(source, ["toe", "knee"], velocity=2) for source in (path, model)]
    assert limits[0] == limits[1]
    np.testing.assert_array_equal(limits[0].position, [[-0.5, -1], [0.25, 1]])


@pytest.mark.parametrize(
    ("joint", "message"),
    [
        ("twin", "joint 'twin' follows an equality constraint; joints to choose from: knee, toe"),
        ("root", "joint 'root' is free or a ball joint"),
        ("hip", "joint 'hip' is free or a ball joint"),
        ("ankle", "no joint 'ankle'"),
    ],
)
def test_joints_of_a_model_that_cannot_be_moved_are_refused(joint: str, message: str) -> None:
    """The error says why and lists the joints to choose from."""
    text = MJCF.format(angle="radian", lower=-1, upper=1)
    with pytest.raises(ValueError, match=f"^model: {message}"):
        Limits.from_mujoco(mujoco.MjModel.from_xml_string(text), [joint])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("hello", "not compiled by MuJoCo: XML parse error"),
        (MJCF.format(angle="radian", lower=1, upper=-1), "joint 'knee': lower = 1.0 is not below"),
        ("<mujoco/>", "has no joint that can be moved"),
    ],
)
def test_bad_models_are_refused(text: str, message: str, tmp_path: Path) -> None:
    """The error names file and fault; a range in the wrong order is not taken for none."""
    path = written(tmp_path, text, "robot.xml")
    with pytest.raises(ValueError) as caught:
        Limits.from_mujoco(path)
    assert str(caught.value).startswith(str(path)) and message in str(caught.value)


def test_other_types_of_models_are_refused() -> None:
    """A model is a path or compiled."""
    with pytest.raises(TypeError, match=r"model = 3: expected a path or a mujoco\.MjModel"):
        Limits.from_mujoco(3)  # type: ignore[arg-type]


def test_missing_mujoco_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the package, the error names it."""
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(ImportError, match="pip install mujoco"):
        Limits.from_mujoco("robot.xml")


def test_limits_of_a_robot_bound_a_controller(reach: pdmp.Model) -> None:
    """A controller takes the limits of one joint for each degree of freedom."""
    joints = REGISTRY["panda"].joints[: reach.n_dofs]
    controller = reach.controller(limits=REGISTRY["panda"].limits(joints))
    for _ in range(10):
        controller.step()
    assert np.isfinite(controller.position).all()
