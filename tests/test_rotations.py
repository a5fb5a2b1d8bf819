"""Unit quaternions as coordinates of a model."""

import copy
import io
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

import pdmp
from pdmp.io import read_csv, write_csv

ROTATIONS = {"qw": "wxyz"}
NAMES = ["x", "y", "z", "qw", "qx", "qy", "qz"]


def turn(axis: ArrayLike, angle: ArrayLike) -> NDArray[np.float64]:
    """Returns the quaternions of turns about an axis."""
    half = np.asarray(angle)[..., None] / 2
    return np.concatenate([np.cos(half), np.sin(half) * np.asarray(axis)], axis=-1)


def times(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns Hamilton products."""
    w = a[..., 0] * b[..., 0] - np.sum(a[..., 1:] * b[..., 1:], axis=-1)
    v = a[..., :1] * b[..., 1:] + b[..., :1] * a[..., 1:] + np.cross(a[..., 1:], b[..., 1:])
    return np.concatenate([w[..., None], v], axis=-1)


def angles(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the angles between rotations."""
    d = times(a * [1, -1, -1, -1], b)
    return 2 * np.arctan2(np.linalg.norm(d[..., 1:], axis=-1), np.abs(d[..., 0]))


def screw(style: float, n: int = 101) -> NDArray[np.float64]:
    """Returns poses (n, 7) that turn by 200 degrees and swing by `style`."""
    s = np.linspace(0.0, 1.0, n)
    m = s**3 * (10 - 15 * s + 6 * s**2)
    bump = np.sin(np.pi * s) ** 2
    q = times(turn([0.6, 0.0, 0.8], 3.5 * m), turn([0.0, 1.0, 0.0], style * bump))
    return np.column_stack([0.3 * m, style * bump, 0.1 * m, q])


def demonstrations() -> list[pdmp.Demonstration]:
    """Returns demonstrations of one style, which is their context."""
    return [
        pdmp.Demonstration(screw(style), dt=0.01, names=NAMES, rotations=ROTATIONS, context=[style])
        for style in (-0.4, -0.1, 0.2, 0.5)
    ]


@pytest.fixture(scope="module")
def model() -> pdmp.Model:
    """Returns a model of four screws."""
    return pdmp.fit(demonstrations(), n_styles=3)


def test_positions_have_coordinates_and_velocities_degrees_of_freedom(model: pdmp.Model) -> None:
    """Positions have a column per coordinate, velocities and accelerations one per DoF."""
    assert (model.n_coordinates, model.n_dofs, model.rotations) == (7, 6, {3: "wxyz"})
    assert model.coordinate_names == NAMES
    assert model.names == ["x", "y", "z", "qx_rot", "qy_rot", "qz_rot"]
    assert model.units[-1] == "rad" and len(model.coordinate_units) == 7
    trajectory = model.rollout(model.conditions(1))
    assert (trajectory.position.shape, trajectory.velocity.shape) == ((101, 7), (101, 6))
    assert (trajectory.names, trajectory.dof_names) == (NAMES, model.names)
    assert model.goals.shape == model.starts.shape == model.anchors.shape == (4, 7)
    assert angles(trajectory.position[:, 3:], screw(-0.1)[:, 3:]).max() < 1e-4
    controller = model.controller()
    controller.step()
    sizes = (controller.position.size, controller.velocity.size, controller.goal.size)
    assert sizes == (7, 6, 7)


def test_columns_are_given_by_index_or_name() -> None:
    """The first column of a quaternion is given by its index or its name."""
    poses = screw(0.2)
    by_name = pdmp.Demonstration(poses, dt=0.01, names=NAMES, rotations={"qw": "wxyz"})
    by_index = pdmp.Demonstration(poses, dt=0.01, rotations={3: "wxyz"})
    assert by_name.rotations == by_index.rotations == {3: "wxyz"}
    assert (by_name.n_coordinates, by_name.n_dofs) == (7, 6)
    assert pickle.loads(pickle.dumps(by_name)).rotations == {3: "wxyz"}
    assert pdmp.Demonstration(poses, dt=0.01).rotations == {}


def test_signs_become_continuous_and_norms_one() -> None:
    """Random signs and small errors of norms are mended without a change of the rotations."""
    poses, rng = screw(0.2), np.random.default_rng(1)
    shaken = poses.copy()
    shaken[:, 3:] *= np.where(rng.random(101) < 0.5, -1, 1)[:, None] * rng.uniform(0.9995, 1.0005)
    mended = pdmp.Demonstration(shaken, dt=0.01, rotations={3: "wxyz"}).position[:, 3:]
    np.testing.assert_allclose(np.linalg.norm(mended, axis=1), 1.0, rtol=1e-15)
    assert np.sum(mended[1:] * mended[:-1], axis=1).min() > 0.99
    assert angles(mended, poses[:, 3:]).max() < 1e-7


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rotations": {3: "wxyz"}, "scale": 1.01}, r"position\[0, 3:7\] has norm 1.01"),
        ({"rotations": {3: "wxyz"}, "scale": 0.0}, r"position\[0, 3:7\] has norm 0"),
        ({"rotations": {4: "wxyz"}}, "must leave room for the four columns"),
        ({"rotations": {-1: "wxyz"}}, "rotations"),
        ({"rotations": {3: "xyz"}}, 'the order must be "wxyz" or "xyzw"'),
        ({"rotations": {"q": "wxyz"}}, "no column named"),
        ({"rotations": ["wxyz"]}, "must map the first column"),
        ({"rotations": {3: "wxyz"}, "goal": np.zeros(7)}, r"goal\[3:7\] has norm 0"),
        ({"rotations": {3: "wxyz"}, "goal": np.zeros(6)}, "one value per coordinate"),
    ],
)
def test_bad_rotations_are_refused(change: dict[str, Any], message: str) -> None:
    """Columns, orders and norms that are wrong are refused with the numbers."""
    change = dict(change)
    poses = screw(0.2)
    poses[:, 3:] *= change.pop("scale", 1.0)
    with pytest.raises(ValueError, match=message):
        pdmp.Demonstration(poses, dt=0.01, **change)


def test_undeclared_quaternions_are_reported() -> None:
    """Columns of unit norm that are not declared as a rotation are reported."""
    with pytest.warns(UserWarning, match=r'rotations=\{3: "wxyz"\}'):
        pdmp.fit([screw(0.1), screw(0.3)], dt=0.01)


def test_commands_in_the_wrong_shape_are_refused(model: pdmp.Model) -> None:
    """Vectors of a wrong length or norm, and calls that rotations do not support, are refused."""
    controller = model.controller()
    goal = model.goals[0]
    for bad, message in ((goal[:6], "coordinate"), (2 * goal, "norm 2")):
        with pytest.raises(ValueError, match=message):
            controller.goal = bad
        with pytest.raises(ValueError, match=message):
            controller.step(measured=bad)
        with pytest.raises(ValueError, match=message):
            model.rollout(start=bad)
        with pytest.raises(ValueError, match=message):
            model.rollouts(goal=np.stack([bad, bad]))
    with pytest.raises(ValueError, match="one value per DoF"):
        model.rollout(velocity=np.zeros(7))
    with pytest.raises(ValueError, match="Jacobians of angular velocities"):
        model.jacobian("style", derivative=1)


def test_limits_bound_the_size_of_angular_velocity_and_acceleration(model: pdmp.Model) -> None:
    """A controller and the fastest movement keep both limits under any commands, and name them."""
    free = [np.inf] * 3
    limits = pdmp.Limits(velocity=[*free, 2.0, 2.0, 2.0], acceleration=[*free, 15.0, 15.0, 15.0])
    conditions = model.conditions(2)
    size = lambda rows: np.linalg.norm(rows[..., 3:], axis=-1)  # noqa: E731
    trajectory = model.rollout(conditions, dt=0.001)
    assert size(trajectory.velocity).max() > 4.0
    ratio, dof, _ = model.feasible(limits, conditions).velocity
    assert dof == 3
    assert ratio == pytest.approx(size(trajectory.velocity).max() / 2.0, rel=1e-4)
    tau = model.fastest_tau(limits, conditions)
    assert model.feasible(limits, conditions, tau=tau).feasible
    fastest = model.fastest(limits, conditions, dt=0.001)
    assert size(fastest.velocity).max() < 2.0 * 1.005
    assert size(fastest.acceleration).max() < 15.0 * 1.01
    assert angles(fastest.position[-1, 3:], trajectory.position[-1, 3:]) < 1e-3

    near = model.nearest_feasible(limits, conditions, tau=0.97 * tau)
    assert model.feasible(limits, near).feasible
    assert not model.feasible(limits, conditions, tau=0.97 * tau).feasible

    controller = model.controller(0.001, conditions, limits=limits)
    np.testing.assert_array_equal(controller.limits.velocity, limits.velocity)
    goal = model.goals[0].copy()
    motion, named = [controller.velocity.copy()], set[str | None]()
    for k in range(3000):
        if k == 300:
            goal[3:] = times(turn([0.0, 0.6, 0.8], 1.5), goal[3:])
            controller.goal, controller.tau = goal, 0.3 * model.tau
        measured = times(turn([1.0, 0.0, 0.0], 0.5), controller.position[3:])
        pushed = np.concatenate([controller.position[:3], measured])
        controller.step(measured=pushed if k % 500 == 400 else None)
        motion.append(controller.velocity.copy())
        named.add(controller.limited[5])
    assert named >= {None, "velocity", "acceleration"}
    assert size(np.array(motion)).max() <= 2.0
    assert size(np.diff(motion, axis=0)).max() <= 15.0 * 0.001 * (1 + 1e-9)


def test_limits_that_depend_on_a_frame_are_refused(model: pdmp.Model) -> None:
    """Unequal limits of the DoFs of a rotation, and limits of its position or jerk, are refused."""
    for limits, message in (
        (
            pdmp.Limits(velocity=[1, 1, 1, 2, 2, 3]),
            "DoF 5: a limit of 3 for the velocity, of DoF 3 2",
        ),
        (pdmp.Limits(position=(-3, 3)), "DoF 3: a rotation has no limit of the position"),
        (pdmp.Limits(acceleration=9, jerk=99), "DoF 3: a rotation has no limit of the jerk"),
    ):
        for call in (
            model.fastest_tau,
            model.feasible,
            lambda limits: model.controller(limits=limits),
        ):
            with pytest.raises(ValueError, match=message):
                call(limits)


def test_contexts_predict_rotations(model: pdmp.Model) -> None:
    """A context predicts the rotations of its movement, singly and in batches."""
    trajectory = model.rollout(context=[0.35])
    assert angles(trajectory.position[:, 3:], screw(0.35)[:, 3:]).max() < 0.02
    batch = model.rollouts(context=[[0.1], [0.35]])[0]
    np.testing.assert_allclose(batch[1], trajectory.position, atol=1e-9)


def test_goal_is_reached_by_any_rotation(model: pdmp.Model) -> None:
    """A goal that turns while the movement is under way is reached without a jump of velocity."""
    controller = model.controller(0.01)
    for k in range(400):
        if k == 30:
            goal = controller.goal
            controller.goal = np.concatenate([goal[:3], times(goal[3:], turn([0, 0, 1], 2.0))])
        before = controller.velocity.copy()
        controller.step()
        assert np.abs(controller.velocity - before).max() < 0.5
    assert controller.status is pdmp.Status.FINISHED
    assert angles(controller.position[3:], controller.goal[3:]) < 0.02


def test_world_frame_turns_angular_velocities(model: pdmp.Model) -> None:
    """Angular velocities in the world frame are those of the body frame, rotated."""
    world = model.in_frame("world")
    assert (model.rotation_frame, world.rotation_frame) == ("body", "world")
    own, other = model.rollout(), world.rollout()
    np.testing.assert_array_equal(own.position, other.position)
    q, omega = own.position[:, 3:], np.pad(own.velocity[:, 3:], ((0, 0), (1, 0)))
    turned = times(times(q, omega), q * [1, -1, -1, -1])[:, 1:]
    np.testing.assert_allclose(other.velocity[:, 3:], turned, atol=1e-12)
    fitted = pdmp.fit(demonstrations(), n_styles=3, rotation_frame="world")
    np.testing.assert_allclose(fitted.rollout().velocity, other.velocity, atol=1e-12)
    with pytest.raises(ValueError, match='must be "body" or "world"'):
        model.in_frame("tool")
    with pytest.raises(ValueError, match="no rotations"):
        pdmp.fit([screw(0.1)[:, :3]], dt=0.01).in_frame("world")


def test_models_controllers_and_trajectories_survive_copies(
    model: pdmp.Model, tmp_path: Path
) -> None:
    """Files, pickles and copies keep rotations and move alike."""
    model.save(tmp_path / "pose.safetensors")
    same = pdmp.load(tmp_path / "pose.safetensors")
    trajectory = model.rollout()
    np.testing.assert_array_equal(same.rollout().velocity, trajectory.velocity)
    assert (same.rotations, same.coordinate_names) == (model.rotations, NAMES)
    controller = model.controller(0.01)
    for _ in range(40):
        controller.step()
    for other in (pickle.loads(pickle.dumps(controller)), copy.copy(controller)):
        np.testing.assert_array_equal(other.position, controller.position)
        np.testing.assert_array_equal(other.velocity, controller.velocity)
    again = pickle.loads(pickle.dumps(trajectory))
    assert (again.rotations, again.dof_names) == (trajectory.rotations, trajectory.dof_names)
    demo = pdmp.Demonstration(trajectory)
    assert (demo.rotations, demo.n_dofs) == ({3: "wxyz"}, 6)
    refitted = pdmp.fit([trajectory])
    assert angles(refitted.rollout().position[:, 3:], trajectory.position[:, 3:]).max() < 1e-3


def test_trajectories_are_tables_of_coordinates_and_degrees_of_freedom(
    model: pdmp.Model, tmp_path: Path
) -> None:
    """Tables have coordinates as positions and DoFs as derivatives, and are read back."""
    trajectory = model.rollout()
    write_csv(tmp_path / "pose.csv", trajectory)
    header = (tmp_path / "pose.csv").read_text(encoding="utf-8").splitlines()[0].split(",")
    assert header[1:8] == NAMES and len(header) == 1 + 7 + 6 + 6
    assert "qx_rot_velocity [rad/s]" in header
    read = read_csv(tmp_path / "pose.csv")
    assert read.position.shape == (101, 7)
    frame = pytest.importorskip("pandas") and trajectory.to_dataframe()
    assert list(frame.columns[:7]) == NAMES and frame.shape == (101, 19)


def test_summaries_and_plots_name_the_coordinates(model: pdmp.Model) -> None:
    """Texts name the DoFs, plots of positions the coordinates."""
    assert "qx_rot [rad]" in repr(model) and "6 DoFs" in repr(demonstrations()[0])
    plot = pytest.importorskip("pdmp.plot")
    pytest.importorskip("matplotlib")
    figure = plot.demonstrations(model, demonstrations())
    figure.savefig(io.BytesIO())
    assert "qw" in {axes.get_ylabel() for axes in figure.axes}


def test_preprocessing_keeps_unit_quaternions() -> None:
    """Resampled quaternions have norm one and follow the rotation."""
    demo = pdmp.Demonstration(screw(0.3, 301), dt=0.005, rotations={3: "wxyz"})
    fine = pdmp.preprocessing.resample(demo, dt=0.0021)
    assert fine.rotations == {3: "wxyz"}
    q = fine.position[:, 3:]
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, rtol=1e-14)
    exact = screw(0.3, 100001)[:, 3:]
    times_of = np.arange(len(q)) * 0.0021
    assert angles(q, exact[np.rint(times_of / 1.5 * 100000).astype(int)]).max() < 1e-4
    assert pdmp.preprocessing.unwrap(demo).rotations == {3: "wxyz"}


def noisy_screws(n: int, seed: int) -> list[pdmp.Demonstration]:
    """Returns screws of random contexts, whose swing deviates by 0.05 rad from the context."""
    rng = np.random.default_rng(seed)
    made = []
    for context in rng.uniform(-0.5, 0.5, n):
        poses = screw(context + 0.05 * rng.normal())
        made.append(
            pdmp.Demonstration(
                poses, dt=0.01, names=NAMES, rotations=ROTATIONS, context=[float(context)]
            )
        )
    return made


@pytest.mark.parametrize("frame", ["body", "world"])
def test_bands_contain_new_orientations_with_their_probability(frame: Any) -> None:
    """Nine of ten new orientations lie within 90 % of bands, also far from the mean path."""
    model = pdmp.fit(noisy_screws(30, 1), n_styles=2, rotation_frame=frame)
    inside = []
    for demo in noisy_screws(200, 2):
        assert demo.context is not None
        lower, upper = model.band(demo.context, level=0.9)
        mean = model.rollout(context=demo.context).position
        n = min(len(mean), demo.n_samples)
        assert lower.shape == upper.shape == (len(mean), 6)
        off = (
            times(mean[:, 3:] * [1, -1, -1, -1], demo.position[:, 3:])
            if frame == "body"
            else (times(demo.position[:, 3:], mean[:, 3:] * [1, -1, -1, -1]))
        )
        off *= np.sign(off[:, :1])
        size = np.linalg.norm(off[:, 1:], axis=1, keepdims=True)
        vector = 2 * np.arctan2(size, off[:, :1]) * off[:, 1:] / np.maximum(size, 1e-300)
        middle = slice(n // 4, 3 * n // 4)
        moving = upper[middle, 3:] > 1e-3
        within = (lower[middle, 3:] <= vector[middle]) & (vector[middle] <= upper[middle, 3:])
        inside.append(within[moving].mean())
    assert 0.85 < np.mean(inside) < 0.95


def test_evaluation_separates_metres_and_angles() -> None:
    """Errors of orientations are geodesic distances in rad, beside distances of the rest."""
    demos = noisy_screws(16, 3)
    evaluation = pdmp.evaluate(demos, predictors={"PDMP": pdmp.evaluation.PDMP(n_styles=2)})
    recordings = evaluation.recordings
    assert recordings.names == ["x", "y", "z", "qx_rot", "qy_rot", "qz_rot"]
    for name in ("mean demonstration", "PDMP"):
        scores = evaluation.score(name)
        for split, made, distance, angle in zip(
            evaluation.splits,
            evaluation.forecasts[name],
            scores.distance,
            scores.angle,
            strict=True,
        ):
            predicted = np.array([forecast.position for forecast in made])
            recorded = recordings.sampled[split.test]
            turned = angles(predicted[..., 3:], recorded[..., 3:])
            assert angle == pytest.approx(np.sqrt(np.mean(turned**2)), rel=1e-9)
            off = np.sum((predicted - recorded)[..., :3] ** 2, axis=-1)
            assert distance == pytest.approx(np.sqrt(off.mean()), rel=1e-9)
    learnt, mean = evaluation.summary("PDMP"), evaluation.summary("mean demonstration")
    assert learnt.angle < 0.3 * mean.angle and learnt.distance < 0.3 * mean.distance
    assert learnt.error == pytest.approx(learnt.distance**2 + learnt.angle**2)
    assert "angle [rad]" in repr(evaluation)


def test_baselines_predict_unit_quaternions() -> None:
    """Baselines learn rotations, and a linear map predicts those of linear demonstrations."""
    evaluation = pdmp.evaluate(noisy_screws(10, 4), max_folds=3)
    assert not evaluation.skipped
    for made in evaluation.forecasts.values():
        for forecast in (forecast for fold in made for forecast in fold):
            norms = np.linalg.norm(forecast.position[:, 3:], axis=1)
            np.testing.assert_allclose(norms, 1, atol=1e-9)
    mean = evaluation.summary("mean demonstration").angle
    for name in ("PCA, linear map", "ProMP weights, linear map"):
        assert evaluation.summary(name).angle < 0.25 * mean
    pytest.importorskip("matplotlib")
    figure = pdmp.plot.held_out(evaluation, "PDMP")
    assert "qy_rot [rad]" in {axes.get_ylabel() for axes in figure.axes}


def test_evaluation_refuses_other_rotations_and_norms() -> None:
    """Demonstrations with other rotations, and predicted norms other than 1, are refused."""

    class Doubled:
        def fit(self, recordings: pdmp.evaluation.Recordings) -> Any:
            forecast = pdmp.evaluation.Forecast(2 * recordings.sampled[0], 1.0)
            return lambda _: forecast

    demos = demonstrations()
    other = pdmp.Demonstration(screw(0.1), dt=0.01, context=[0.1])
    with pytest.raises(ValueError, match="demo 4: rotations {}, expected {3: 'wxyz'}"):
        pdmp.evaluate([*demos, other])
    with pytest.raises(ValueError, match="norms deviate from 1 by 1"):
        pdmp.evaluate(demos, predictors={"doubled": Doubled()})


PERIOD = 1.03


def wobble(
    swing: float, *, turns: int = 0, drift: float = 0.0, noise: float = 0.0, n: int = 1000
) -> pdmp.Demonstration:
    """Returns a cyclic recording that swings, and makes full turns per cycle or drifts."""
    rng = np.random.default_rng(5)
    t = 0.01 * np.arange(n)
    phase = 2 * np.pi * t / PERIOD
    q = times(turn([0, 0, 1], turns * phase + drift * t), turn([1, 0, 0], swing * np.sin(phase)))
    q = times(q, turn([0, 1, 0], 0.2 * np.cos(2 * phase + 0.3)))
    v = noise * rng.normal(size=(n, 3))
    angle = np.linalg.norm(v, axis=1) + 1e-300
    q = times(q, turn(v / angle[:, None], angle))
    height = 1 + 0.02 * np.sin(2 * phase) + 1e-3 * noise * rng.normal(size=n)
    names = ["z", "qw", "qx", "qy", "qz"]
    poses = np.column_stack([height, q])
    return pdmp.Demonstration(poses, dt=0.01, names=names, rotations=ROTATIONS)


@pytest.mark.parametrize("turns", [0, 1, 2])
@pytest.mark.parametrize("noise", [0.0, 0.03])
def test_cycles_of_rotations_are_found_and_closed(turns: int, noise: float) -> None:
    """Cycles have the period of the rotation, also where quaternions change sign."""
    recording = wobble(0.4, turns=turns, noise=noise)
    assert pdmp.preprocessing.period(recording) == pytest.approx(PERIOD, abs=0.002)
    cycles = pdmp.preprocessing.cycles(recording)
    assert len(cycles) == 9 and not cycles.rejected and not cycles.growths
    assert cycles.gains.shape == (9, 4)
    np.testing.assert_allclose(cycles.periods, PERIOD, atol=0.03 if noise else 1e-3)
    expected = wobble(0.4, turns=turns).position[:103, 1:]
    for cycle in cycles:
        assert angles(cycle.position[:, 1:], expected[: cycle.n_samples]).max() < 6 * noise + 0.01
    [mean] = pdmp.preprocessing.cycles(recording, average=True)
    assert angles(mean.position[:, 1:], expected).max() < 2 * noise + 0.01
    model = pdmp.fit([mean], kind="rhythmic")
    rollout = model.rollout(dt=0.01, duration=1.02)
    assert angles(rollout.position[:, 1:], expected).max() < 2 * noise + 0.01


def test_gains_of_rotations_are_removed_and_reported() -> None:
    """A heading that drifts ends where it began in closed cycles, and a large drift is reported."""
    cycles = pdmp.preprocessing.cycles(wobble(0.4, drift=0.05))
    np.testing.assert_allclose(
        np.linalg.norm(cycles.gains[:, 1:], axis=1), 0.05 * PERIOD, rtol=0.01
    )
    for cycle in cycles:
        step = angles(cycle.position[:1, 1:], cycle.position[-1:, 1:])
        within = angles(cycle.position[1:, 1:], cycle.position[:-1, 1:])
        assert step < within.max()
    onsets = PERIOD * np.arange(10)
    with pytest.warns(UserWarning, match="'qz_rot' gains 0.506 rad in recording 0"):
        pdmp.preprocessing.cycles(wobble(0.01, drift=0.5), onsets=onsets)


@pytest.mark.parametrize("turns", [0, 1])
def test_styles_of_new_cycles_do_not_depend_on_their_phase(turns: int) -> None:
    """A new cycle that begins at another phase has the style of the same cycle in phase."""
    n = round(100 * PERIOD)
    cycles = [wobble(swing, turns=turns, n=n) for swing in (0.2, 0.3, 0.4, 0.5)]
    model = pdmp.fit(cycles, kind="rhythmic", n_styles=1)
    new = wobble(0.35, turns=turns, n=n)
    style = model.style_of(new)
    low, high = sorted([model.styles[1, 0], model.styles[2, 0]])
    assert low < style[0] < high
    for lead in (7, 30, 51, 80):
        rolled = np.roll(new.position, -lead, axis=0)
        shifted = pdmp.Demonstration(rolled, dt=0.01, names=new.names, rotations=ROTATIONS)
        np.testing.assert_allclose(model.style_of(shifted), style, atol=2e-3)
    stamped = pdmp.Demonstration(
        np.roll(new.position, -30, axis=0), time=new.time, names=new.names, rotations=ROTATIONS
    )
    np.testing.assert_allclose(model.style_of(stamped, period=PERIOD), style, atol=2e-3)
    other = wobble(0.35, turns=turns + 1, n=n)
    with pytest.raises(ValueError, match="degrees from the mean|does not describe"):
        model.style_of(other)


def share_of(tempo: float, n: int = 151) -> NDArray[np.float64]:
    """Returns the share of the movement at equal shares of time, early or late by the tempo."""
    t = np.linspace(0, 1, n)
    return t + tempo * np.sin(np.pi * t) ** 2 * np.sin(2 * np.pi * t) / np.pi


def turned(
    swing: float, tempo: float, tool: NDArray[np.float64] | None = None
) -> pdmp.Demonstration:
    """Returns a pose that turns, swings and wobbles at an uneven tempo."""
    u = share_of(tempo)
    m, bump = u**3 * (10 - 15 * u + 6 * u**2), np.sin(np.pi * u) ** 2
    q = times(turn([0.6, 0.0, 0.8], 3.5 * m), turn([0.0, 1.0, 0.0], swing * bump))
    q = times(q, turn([1.0, 0.0, 0.0], 0.5 * np.sin(4 * np.pi * u) * bump))
    if tool is not None:
        q = times(q, np.tile(tool, (len(q), 1)))
    poses = np.column_stack([0.3 * m, 0.2 * bump, 0.1 * m, q])
    return pdmp.Demonstration(poses, dt=0.01, rotations={3: "wxyz"})


TEMPOS = (0.3, -0.3, 0.2, -0.2, 0.0, 0.25, -0.1)
SWINGS = (-0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3)


def misfit(model: pdmp.Model, demos: list[pdmp.Demonstration]) -> float:
    """Returns the root mean square angle between demonstrations and their reproductions."""
    off = []
    for m, demo in enumerate(demos):
        made = model.rollout(model.conditions(m), dt=0.01).position
        n = min(len(made), demo.n_samples)
        off.append(angles(made[:n, 3:], demo.position[:n, 3:]))
    return float(np.sqrt(np.mean(np.concatenate(off) ** 2)))


def test_time_warps_align_rotations() -> None:
    """A warp reproduces the tempo of demonstrations of one shape by one style, linear time not."""
    demos = [turned(0.0, tempo) for tempo in TEMPOS]
    linear = pdmp.fit(demos, n_styles=1)
    warped = pdmp.fit(demos, n_styles=1, alignment=pdmp.TimeWarp(20))
    assert misfit(linear, demos) > 0.1 and misfit(warped, demos) < 0.015
    trajectory = warped.rollout(warped.conditions(0), dt=1e-3)
    q = trajectory.position[:, 3:]
    step = times(q[:-2] * [1, -1, -1, -1], q[2:])
    np.testing.assert_allclose(step[:, 1:] / 1e-3, trajectory.velocity[1:-1, 3:], atol=0.05)


def test_time_warps_do_not_depend_on_the_tool_frame() -> None:
    """Demonstrations of another tool frame have the same warp and the same movement."""
    tool = turn(np.array([0.36, 0.48, 0.8]), np.array(1.1))
    models = [
        pdmp.fit(
            [turned(swing, tempo, frame) for swing, tempo in zip(SWINGS, TEMPOS, strict=True)],
            alignment=pdmp.TimeWarp(12),
        )
        for frame in (None, tool)
    ]
    first, second = (model.segment_durations for model in models)
    np.testing.assert_allclose(first, second, atol=1e-12)
    own, other = (model.rollout(model.conditions(1)).position[:, 3:] for model in models)
    assert angles(times(own, np.tile(tool, (len(own), 1))), other).max() < 1e-10


@pytest.mark.parametrize("by", ["warp", "landmarks"])
def test_styles_of_warped_rotations_are_found_again(by: str) -> None:
    """The style of a demonstration given as a new one is its own, in the time of the model."""
    demos = [turned(swing, tempo) for swing, tempo in zip(SWINGS, TEMPOS, strict=True)]
    events = [0.2, 0.35, 0.5, 0.65, 0.8]
    landmarks = [
        np.interp(events, share_of(tempo), 1.5 * np.linspace(0, 1, 151)) for tempo in TEMPOS
    ]
    timed: dict[str, Any] = {"landmarks": landmarks}
    if by == "warp":
        timed = {"alignment": pdmp.TimeWarp(20)}
    alike = [turned(0.0, tempo) for tempo in TEMPOS]
    linear = pdmp.fit(alike, n_styles=1)
    assert misfit(pdmp.fit(alike, n_styles=1, **timed), alike) < 0.25 * misfit(linear, alike)
    assert misfit(pdmp.fit(demos, n_styles=7, **timed), demos) < 1e-4
    model = pdmp.fit(demos, n_styles=3, **timed, contexts=[[swing] for swing in SWINGS])
    for m, demo in enumerate(demos):
        given = {"landmarks": landmarks[m]} if by == "landmarks" else {}
        style = model.style_of(demo, **given)  # type: ignore[arg-type]
        np.testing.assert_allclose(style, model.styles[m], atol=0.02)
    if by == "landmarks":
        with pytest.raises(ValueError, match="landmarks is missing"):
            model.style_of(demos[0])
        lower, upper = model.band([0.15])
        assert lower.shape[1] == 6 and (upper >= lower).all()
        width = (upper - lower)[:, 3:].max(axis=1)
        assert width[len(width) // 2] > 3 * width[0]
