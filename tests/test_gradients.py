"""Gradients through movements: vector-Jacobian products, and their wrappers for torch and jax."""

import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import pdmp
from synthetic import DT

RNG = np.random.default_rng(0)
STYLES = RNG.normal(size=(7, 2))


def centre_of(model: pdmp.Model) -> str:
    """Returns the name of the argument that moves a batch as a whole."""
    return "goal" if model.kind == "discrete" else "anchor"


def cost(movements: tuple[Any, ...]) -> Any:
    """Returns a loss that is not linear in positions and their derivatives."""
    positions, *slopes = movements
    squares = (
        weight * (array**2).sum() for weight, array in zip((0.1, 1e-3), slopes, strict=False)
    )
    return (positions**2 * (1 + positions)).sum() + sum(squares)


def cotangents(movements: tuple[Any, ...]) -> tuple[Any, ...]:
    """Returns the derivatives of `cost`."""
    positions, *slopes = movements
    by_slopes = (2 * weight * array for weight, array in zip((0.1, 1e-3), slopes, strict=False))
    return 2 * positions + 3 * positions**2, *by_slopes


def pose(phase: Any, turn: Any, lean: float) -> Any:
    """Returns quaternions x, y, z, w that turn about z and lean, and two coordinates."""
    z, x = turn / 2, lean * np.sin(phase) ** 2 / 2
    quaternion = [np.sin(x) * np.cos(z), np.sin(x) * np.sin(z), np.cos(x) * np.sin(z)]
    return np.column_stack(
        [*quaternion, np.cos(x) * np.cos(z), np.sin(phase), lean * np.cos(phase)]
    )


@pytest.fixture(scope="module", params=["discrete", "rhythmic"])
def poses(request: pytest.FixtureRequest) -> pdmp.Model:
    """Returns a model of a rotation and two coordinates, with angular velocities in the world."""
    kind: Any = request.param
    s = np.linspace(0, 1, 81, endpoint=kind == "discrete")
    if kind == "discrete":
        phase, turn = np.pi * s, 3.5 * s**3 * (10 - 15 * s + 6 * s**2)
    else:
        phase, turn = 2 * np.pi * s, 0.8 * np.sin(2 * np.pi * s)
    demos = [
        pdmp.Demonstration(pose(phase, turn * (1 + lean / 4), lean), dt=DT, rotations={0: "xyzw"})
        for lean in (-0.6, -0.2, 0.3, 0.7)
    ]
    return pdmp.fit(demos, kind=kind, n_styles=2, rotation_frame="world")


def posed_for(model: pdmp.Model) -> dict[str, Any]:
    """Returns conditions of a batch of poses with velocities, some shared."""

    def places(*shape: int) -> Any:
        quaternions = RNG.normal(size=(*shape, 4))
        quaternions /= np.linalg.norm(quaternions, axis=-1, keepdims=True)
        return np.concatenate([quaternions, RNG.normal(size=(*shape, 2))], axis=-1)

    given: dict[str, Any] = {
        "style": RNG.uniform(-0.5, 0.5, size=(3, 2)),
        centre_of(model): places(3),
        "start": places(),
        "velocity": RNG.normal(size=(3, 5)),
        "tau": model.tau * np.linspace(0.7137, 1.9, 3),
    }
    if model.kind == "discrete":
        return {**given, "goal_velocity": RNG.normal(size=5)}
    return {**given, "amplitude": np.linspace(0.3, 2.0, 3)}


def difference(model: pdmp.Model, given: dict[str, Any], name: str, options: Any) -> Any:
    """Returns the central differences of `cost` by the elements of one condition."""
    value = np.asarray(given[name], dtype=float)
    found = np.zeros(value.shape)
    for index in np.ndindex(value.shape):
        step = np.zeros(value.shape)
        step[index] = 1e-5
        ahead, behind = (
            cost(
                model.rollouts(**{"derivatives": 2, **given, name: value + sign * step, **options})
            )
            for sign in (1, -1)
        )
        found[index] = (ahead - behind) / 2e-5
    return found


def given_for(model: pdmp.Model) -> dict[str, Any]:
    """Returns conditions of a batch, of which the start is shared."""
    given: dict[str, Any] = {
        "style": STYLES,
        centre_of(model): RNG.normal(size=(7, 2)),
        "start": RNG.normal(size=2),
        "velocity": RNG.normal(size=(7, 2)),
        "tau": 1.2 * model.tau,
    }
    if model.kind == "discrete":
        return {**given, "goal_velocity": RNG.normal(size=(7, 2))}
    return {**given, "amplitude": 0.7}


def timed_for(model: pdmp.Model) -> dict[str, Any]:
    """Returns conditions of a batch whose movements differ in tau and, if rhythmic, in amplitude.

    No movement ends at a sample: its acceleration jumps there, and its velocity has no derivative
    with respect to tau.
    """
    given = {**given_for(model), "tau": model.tau * np.linspace(0.7137, 1.9, 7)}
    return {**given, **({"amplitude": np.linspace(0.3, 2.0, 7)} if "amplitude" in given else {})}


@pytest.mark.parametrize("conditions", [given_for, timed_for])
def test_gradients_are_differences_of_costs(model: pdmp.Model, conditions: Any) -> None:
    """The products are the gradients of a cost of movements by every condition."""
    given = conditions(model)
    options: dict[str, Any] = {"dt": 0.002, "duration": 1.3}
    if conditions is timed_for and model.kind == "rhythmic":
        options["phase"] = np.linspace(-1.0, 5.0, 7)
    wrt: Any = list(given)
    movements = model.rollouts(**given, derivatives=2, **options)
    found = model.rollouts_vjp(wrt, cotangents(movements), **given, **options)
    for name, gradient in zip(wrt, found, strict=True):
        expected = difference(model, given, name, options)
        total = gradient if np.ndim(given[name]) == gradient.ndim else gradient.sum(axis=0)
        assert total.shape == expected.shape
        np.testing.assert_allclose(total, expected, rtol=1e-5, atol=1e-6 * abs(expected).max())


@pytest.mark.parametrize("shares_tau", [True, False])
def test_gradients_of_poses_are_differences_of_costs(poses: pdmp.Model, shares_tau: bool) -> None:
    """Rotations have gradients by every condition, those by a quaternion orthogonal to it."""
    given = posed_for(poses)
    if shares_tau:
        given["tau"] = 1.3 * poses.tau
    options: dict[str, Any] = {"dt": 0.01, "duration": 1.7}
    wrt: Any = list(given)
    movements = poses.rollouts(**given, derivatives=1, **options)
    found = poses.rollouts_vjp(wrt, cotangents(movements), **given, **options)
    for name, gradient in zip(wrt, found, strict=True):
        expected = difference(poses, given, name, {"derivatives": 1, **options})
        total = gradient if np.ndim(given[name]) == gradient.ndim else gradient.sum(axis=0)
        assert total.shape == expected.shape
        np.testing.assert_allclose(total, expected, rtol=1e-5, atol=1e-6 * abs(expected).max())
        if name in ("goal", "anchor", "start"):
            along = (gradient * given[name])[:, :4].sum(axis=1)
            np.testing.assert_allclose(along, 0.0, atol=1e-12 * abs(gradient).max())
    along = movements[0].copy()
    along[:, :, 4:] = 0.0
    for gradient in poses.rollouts_vjp(wrt, along, **given, **options):
        np.testing.assert_allclose(gradient, 0.0, atol=1e-11)


def test_accelerations_of_poses_have_no_gradient_by_tau(poses: pdmp.Model) -> None:
    """A change of tau needs the jerk, which rotations do not have; other gradients need none."""
    movements = poses.rollouts(derivatives=2)
    assert poses.rollouts_vjp("style", movements)[0].shape == (1, 2)
    with pytest.raises(ValueError, match="tau does not apply to accelerations"):
        poses.rollouts_vjp("tau", movements)


def test_a_jacobian_is_that_from_phase_0(cycle: pdmp.Model) -> None:
    """A Jacobian does not take a phase, which its responses do not have."""
    with pytest.raises(ValueError, match="phase does not apply"):
        cycle.jacobian("style", phase=1.0)


def test_segment_durations_have_gradients_but_for_tau() -> None:
    """Movements in warped time have exact gradients; tau, which they do not have, is refused."""
    s = np.linspace(0, 1, 101)
    demos = [
        np.column_stack([s**power, h * np.sin(np.pi * s**power)])
        for h in (0.2, 0.4)
        for power in (1.0, 1.5)
    ]
    model = pdmp.fit(demos, dt=0.01, n_styles=2, alignment=pdmp.TimeWarp(4))
    given: dict[str, Any] = {"style": RNG.normal(size=(3, 2)), "goal": RNG.normal(size=(3, 2))}
    options = {"dt": 0.005, "duration": 1.2, "segment_durations": model.segment_durations[:3]}
    movements = model.rollouts(**given, derivatives=2, **options)
    found = model.rollouts_vjp(["style", "goal"], cotangents(movements), **given, **options)
    for name, gradient in zip(given, found, strict=True):
        expected = difference(model, given, name, options)
        np.testing.assert_allclose(gradient, expected, rtol=1e-5, atol=1e-6 * abs(expected).max())
    with pytest.raises(ValueError, match="tau does not apply to movements that follow"):
        model.rollouts_vjp("tau", movements[0], **given, **options)


def test_products_are_those_with_jacobians(model: pdmp.Model) -> None:
    """The gradients of one movement equal the contraction of cotangents with its Jacobians."""
    given = {name: np.atleast_2d(v)[0] for name, v in given_for(model).items() if name != "tau"}
    if "amplitude" in given:
        given["amplitude"] = 0.7
    for derivative in range(3):
        arrays = [np.zeros((1, 101, 2)) for _ in range(derivative + 1)]
        arrays[-1] = RNG.normal(size=(1, 101, 2))
        wrt: Any = [*given, "tau"]
        found = model.rollouts_vjp(wrt, tuple(arrays), duration=1.0, **given)
        for name, gradient in zip(wrt, found, strict=True):
            jacobian = model.jacobian(name, derivative=derivative, duration=1.0, **given)
            expected = np.einsum("tdj,td->j", jacobian, arrays[-1][0])
            np.testing.assert_allclose(gradient.ravel(), expected, rtol=1e-9, atol=1e-9)


def test_positions_alone_and_one_name(reach: pdmp.Model) -> None:
    """One array of cotangents and one name need no tuple; threads leave the result unchanged."""
    array = RNG.normal(size=(7, 101, 2))
    (alone,) = reach.rollouts_vjp("style", array, style=STYLES, duration=1.0)
    several = reach.rollouts_vjp(["style"], (array,), style=STYLES, duration=1.0, threads=1)
    np.testing.assert_array_equal(alone, several[0])
    assert alone.shape == (7, 2)


@pytest.mark.parametrize(
    ("wrt", "shape", "message"),
    [
        ("style", (7, 101), r"cotangents has shape \[7, 101\]"),
        ("style", (7, 100, 2), "cotangents must be one to three arrays"),
        ("mass", (7, 101, 2), "wrt = 'mass': must be \"style\""),
        ("anchor", (7, 101, 2), "anchor does not apply"),
        ("velocity", (7, 101, 2), "velocity is not among the conditions"),
    ],
)
def test_errors_name_the_argument(
    reach: pdmp.Model, wrt: Any, shape: tuple[int, ...], message: str
) -> None:
    """Wrong arguments of a product are named."""
    with pytest.raises(ValueError, match=message):
        reach.rollouts_vjp(wrt, np.zeros(shape), style=STYLES, duration=1.0)


def test_autodiff_imports_no_framework() -> None:
    """The module imports neither torch nor jax."""
    code = "import sys, pdmp.autodiff; assert not {'torch', 'jax'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_jax_differentiates_through_movements(model: pdmp.Model) -> None:
    """Gradients by jax are those of rollouts, also compiled, and of shared conditions."""
    jax = pytest.importorskip("jax")
    with jax.enable_x64(True):
        given, options = given_for(model), {"dt": 0.002, "duration": 1.3}
        move = pdmp.autodiff.jax_rollouts(model, derivatives=2, **options)

        def loss(given: dict[str, Any]) -> Any:
            return cost(move(**given))

        for gradient in (jax.grad(loss), jax.jit(jax.grad(loss))):
            found = gradient({n: jax.numpy.asarray(v, dtype=float) for n, v in given.items()})
            for name in given:
                expected = difference(model, given, name, options)
                assert found[name].shape == expected.shape
                scale = abs(expected).max()
                np.testing.assert_allclose(found[name], expected, rtol=1e-5, atol=1e-6 * scale)
        for made, expected in zip(
            move(**given), model.rollouts(**given, derivatives=2, **options), strict=True
        ):
            np.testing.assert_array_equal(made, expected)
        mapped = jax.vmap(lambda style: move(style=style)[0][0])(STYLES)
        np.testing.assert_array_equal(mapped, model.rollouts(style=STYLES, **options)[0])


def assert_jax_accepts_gradients(model: pdmp.Model, given: dict[str, Any], **options: Any) -> None:
    """Compares compiled gradients with differences by `jax.test_util.check_grads`."""
    jax = pytest.importorskip("jax")
    check_grads = pytest.importorskip("jax.test_util").check_grads
    with jax.enable_x64(True):
        arrays = {n: jax.numpy.asarray(v, dtype=float) for n, v in given.items()}
        move = jax.jit(pdmp.autodiff.jax_rollouts(model, **options))
        check_grads(
            lambda given: move(**given), (arrays,), 1, ["rev"], eps=1e-6, atol=1e-6, rtol=1e-5
        )


def test_jax_checks_gradients_of_different_tau(model: pdmp.Model) -> None:
    """`jax.test_util.check_grads` accepts gradients of movements that differ in tau."""
    assert_jax_accepts_gradients(model, timed_for(model), derivatives=2, dt=0.05, duration=1.3)


def test_jax_checks_gradients_of_poses(poses: pdmp.Model) -> None:
    """`jax.test_util.check_grads` accepts gradients of rotations and angular velocities."""
    assert_jax_accepts_gradients(poses, posed_for(poses), derivatives=1, dt=0.41, duration=1.7)


def test_jax_keeps_single_precision(reach: pdmp.Model) -> None:
    """Conditions in single precision have movements and gradients in it."""
    jax = pytest.importorskip("jax")
    move = pdmp.autodiff.jax_rollouts(reach, dt=0.01)
    style = jax.numpy.asarray(STYLES, dtype="float32")
    (positions,) = move(style=style)
    gradient = jax.grad(lambda style: move(style=style)[0].sum())(style)
    assert positions.dtype == gradient.dtype == "float32"


def test_torch_differentiates_through_movements(model: pdmp.Model) -> None:
    """Gradients by torch are those of rollouts, of shared conditions too."""
    torch = pytest.importorskip("torch")
    given, options = given_for(model), {"dt": 0.002, "duration": 1.3}
    move = pdmp.autodiff.torch_rollouts(model, derivatives=2, **options)
    tensors = {
        name: torch.tensor(value, dtype=torch.float64, requires_grad=True)
        for name, value in given.items()
    }
    cost(move(**tensors)).backward()
    for name, tensor in tensors.items():
        expected = difference(model, given, name, options)
        scale = abs(expected).max()
        np.testing.assert_allclose(tensor.grad, expected, rtol=1e-5, atol=1e-6 * scale)


def test_torch_checks_gradients_of_different_tau(model: pdmp.Model) -> None:
    """`torch.autograd.gradcheck` accepts gradients of movements that differ in tau."""
    torch = pytest.importorskip("torch")
    given = {name: torch.tensor(value[:3]).double() for name, value in timed_for(model).items()}
    move = pdmp.autodiff.torch_rollouts(model, derivatives=2, dt=0.05, duration=1.3)

    def moved(*values: Any) -> Any:
        *rest, accelerations = move(**dict(zip(given, values, strict=True)))
        # Their derivatives by tau reach 1e4: differences have nine digits.
        return *rest, 1e-3 * accelerations

    tensors = [value.requires_grad_() for value in given.values()]
    assert torch.autograd.gradcheck(moved, tensors, eps=1e-6, atol=1e-6, rtol=1e-5)


def test_torch_checks_gradients_of_poses(poses: pdmp.Model) -> None:
    """`torch.autograd.gradcheck` accepts gradients of rotations and their derivatives."""
    torch = pytest.importorskip("torch")
    given = {name: torch.tensor(value).double() for name, value in posed_for(poses).items()}
    for derivatives in (1, 2):
        move = pdmp.autodiff.torch_rollouts(poses, derivatives=derivatives, dt=0.05, duration=1.7)
        names = [name for name in given if derivatives < 2 or name != "tau"]

        def moved(*values: Any, move: Any = move, names: Any = names) -> Any:
            return move(**{**given, **dict(zip(names, values, strict=True))})

        tensors = [given[name].clone().requires_grad_() for name in names]
        assert torch.autograd.gradcheck(
            moved, tensors, eps=1e-6, atol=1e-5, rtol=1e-5, fast_mode=True
        )


def test_torch_keeps_types(reach: pdmp.Model) -> None:
    """Conditions without gradients get none, and single precision is kept."""
    torch = pytest.importorskip("torch")
    move = pdmp.autodiff.torch_rollouts(reach)
    style = torch.tensor(STYLES, dtype=torch.float32, requires_grad=True)
    (positions,) = move(style=style, goal=torch.ones(2))
    positions.sum().backward()
    assert positions.dtype == style.grad.dtype == torch.float32
