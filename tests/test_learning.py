"""Learning, compared with numpy and scipy, and on human handwriting."""

import inspect
import warnings
from typing import Any

import numpy as np
import pytest

import pdmp
from pdmp import Demonstration
from pdmp.datasets import handwriting
from synthetic import loops, reaches

integrate = pytest.importorskip("scipy.integrate")
interpolate = pytest.importorskip("scipy.interpolate")


def shapes(*names: str) -> dict[str, list[Demonstration]]:
    """Returns recordings of handwriting, or skip where they are not installed."""
    try:
        return handwriting(names or None)
    except ImportError as error:
        pytest.skip(str(error))


def reproduction_error(model: pdmp.Model, demos: list[Demonstration], m: int) -> float:
    """Returns the RMSE of a demonstration's reproduction over the larger of its DoFs' ranges."""
    demo = demos[m]
    time = demo.time - demo.time[0]
    dt = model.durations[m] / (demo.n_samples - 1)
    made = model.rollout(model.conditions(m), dt=dt)
    expected = interpolate.CubicSpline(time, demo.position)(made.time)
    return float(np.sqrt(np.mean((made.position - expected) ** 2)) / np.ptp(demo.position, 0).max())


@pytest.mark.parametrize("name", ["WShape", "GShape", "Sine", "Multi_Models_3"])
def test_gp_reproduces_handwriting(name: str) -> None:
    """With J = M, the error of every reproduction is at most 1e-4 of the range."""
    demos = shapes(name)[name]
    model = pdmp.fit(demos, n_styles=7)
    assert max(reproduction_error(model, demos, m) for m in range(7)) <= 1e-4


def test_network_reproduces_all_handwriting() -> None:
    """With J = M and 50 functions, reproductions of 30 shapes are accurate to 1e-3."""
    for name, demos in shapes().items():
        model = pdmp.fit(demos, n_styles=7, basis="ngnet")
        worst = max(reproduction_error(model, demos, m) for m in range(7))
        assert worst <= 1e-3, name


def filtered(model: pdmp.Model, spline: Any, centre: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Returns z (C, D) of Eq. (1) driven by y(u) from z = 0, integrated by scipy."""

    def slope(u: float, z: np.ndarray) -> np.ndarray:
        return model.alpha_z * (model.beta_z * (centre - spline(u)) - z)

    solution = integrate.solve_ivp(
        slope, (u[0], u[-1]), np.zeros(len(centre)), "DOP853", u, rtol=1e-11, atol=1e-12
    )
    return solution.y.T


@pytest.mark.parametrize("transport", ["learnt", "immediate"])
def test_singular_values_are_those_of_the_targets_of_reaches(transport: Any) -> None:
    """Singular values are those of targets f = e' - z about the frame, computed by scipy."""
    demos = reaches()
    n = 120
    model = pdmp.fit(demos, n_styles=3, n_samples=n, transport=transport)
    targets = []
    for demo in demos:
        own = interpolate.CubicSpline(np.linspace(0, 1, demo.n_samples), demo.position)
        u = np.linspace(0, 1, n)
        frame = np.outer(model.transport(u), own(1) - own(0))
        spline = interpolate.CubicSpline(u, own(u) - own(0) - frame)
        targets.append((spline(u, 1) - filtered(model, spline, np.zeros(2), u)).ravel())
    left, sigma, _ = np.linalg.svd(targets, full_matrices=False)
    np.testing.assert_allclose(model.singular_values, sigma, rtol=1e-6, atol=1e-9 * sigma[0])
    np.testing.assert_allclose(np.abs(model.styles), np.abs(left[:, :3]), atol=1e-6)


def test_singular_values_are_those_of_the_targets_of_loops() -> None:
    """For cycles, z is the periodic steady state, computed as the second of two periods."""
    model = pdmp.fit(loops(), kind="rhythmic", n_styles=2, n_samples=100)
    u = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    targets = []
    for demo in loops():
        closed = np.vstack([demo.position, demo.position[:1]])
        spline = interpolate.CubicSpline(np.append(u, 2 * np.pi), closed, bc_type="periodic")
        z = filtered(model, spline, demo.position.mean(axis=0), np.append(u, u + 2 * np.pi))[100:]
        targets.append((spline(u, 1) - z).ravel())
    sigma = np.linalg.svd(targets, compute_uv=False)
    np.testing.assert_allclose(model.singular_values, sigma, rtol=1e-6, atol=1e-9 * sigma[0])


def test_sharp_turns_between_few_samples_are_kept() -> None:
    """Jumps within a sampling interval are reproduced."""
    u = np.linspace(0, 1, 101)[:, None]
    demos = [size * (u > 0.005) * (1.5 + np.cos(9 * u)) * (1 - u) for size in (1, 2, 3)]
    model = pdmp.fit(demos, dt=0.01, singular_value_share=1.0)
    coarse = pdmp.fit(demos, dt=0.01, singular_value_share=1.0, n_samples=101)
    off = [
        np.abs(each.rollout(each.conditions(2), dt=0.01).position - demos[2]).max()
        for each in (model, coarse)
    ]
    assert off[0] < 0.02 < 0.1 < off[1]


@pytest.mark.parametrize("n_styles", [1, 3, 5])
def test_styles_are_orthonormal(n_styles: int) -> None:
    """The columns of S are the first J columns of U."""
    styles = pdmp.fit(reaches(), n_styles=n_styles).styles
    np.testing.assert_allclose(styles.T @ styles, np.eye(n_styles), atol=1e-12)


@pytest.mark.parametrize("share", [0.5, 0.9, 0.99, 0.999999, 1.0])
def test_singular_value_share_selects_the_smallest_number(share: float) -> None:
    """J is the smallest whose sum of singular values exceeds the share."""
    model = pdmp.fit(reaches(), singular_value_share=share)
    shares = np.cumsum(model.singular_values) / model.singular_values.sum()
    assert model.n_styles == min(5, 1 + np.sum(shares <= share))


@pytest.mark.parametrize("overlap", [0.5, 1.2, 2.0])
@pytest.mark.parametrize("periodic", [False, True])
def test_network_is_a_sum_of_the_stated_functions(periodic: bool, overlap: float) -> None:
    """The network is b(u) = Σ wₖψₖ(u) / Σ ψₖ(u) of width s = overlap·h for some weights."""
    end, n = 2 * np.pi, 20
    u = np.linspace(0, end, 200, endpoint=not periodic)
    h = end / n if periodic else end / (n - 5)
    s = overlap * h
    r = u[:, None] - h * (np.arange(n) - (0 if periodic else 2))
    psi = np.exp((np.cos(r) - 1) / s**2) if periodic else np.exp(-(r**2) / (2 * s**2))
    psi /= psi.sum(axis=1, keepdims=True)
    targets = np.exp(np.sin(3 * r[:, :2]))
    learnt, _ = pdmp.NGnet(n, overlap).regress(u, targets, periodic=periodic).predict(u)
    weights = np.linalg.lstsq(psi, learnt)[0]
    np.testing.assert_allclose(psi @ weights, learnt, atol=1e-10)


def test_defaults_of_a_network_are_those_of_its_signature() -> None:
    """The defaults in the signature are those in use."""
    parameters = inspect.signature(pdmp.NGnet).parameters
    used = pdmp.NGnet()
    assert (parameters["n_basis"].default, parameters["overlap"].default) == (
        used.n_basis,
        used.overlap,
    )
    assert repr(used) == f"pdmp.NGnet({used.n_basis}, overlap={used.overlap})"


def noisy() -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Returns six movements of rank two, clean and with 1 % noise."""
    s = np.linspace(0, 1, 201)
    rise, bump = s**3 * (10 - 15 * s + 6 * s**2), np.sin(2 * np.pi * s) ** 3
    clean = [np.column_stack([rise + k * bump, k * rise]) for k in (-1, -0.6, -0.2, 0.2, 0.6, 1)]
    random = np.random.default_rng(3)
    return clean, [x + 0.01 * random.normal(size=x.shape) for x in clean]


def test_automatic_smoothing_reduces_the_error() -> None:
    """With 1 % noise, the reproduction is closer to the clean movement than the recording is."""
    clean, recorded = noisy()

    def error(smoothing: Any) -> float:
        model = pdmp.fit(recorded, dt=0.01, n_styles=2, smoothing=smoothing)
        made = [model.rollout(model.conditions(m)).position for m in range(6)]
        return float(np.sqrt(np.mean(np.square(np.array(made) - clean))))

    assert error("auto") < 0.7 * 0.01
    assert error("auto") < 0.5 * error(None)


def _reach(*bends: float) -> np.ndarray:
    """Returns a reach of length 1 (101, 2) with bends of several shapes."""
    s = np.linspace(0, 1, 101)[:, None]
    shapes = [np.sin(np.pi * (j + 1) * s) * (4 * s * (1 - s)) ** 2 for j in range(len(bends))]
    rise = s**3 * (10 - 15 * s + 6 * s**2) * [1.0, 0.6]
    return rise + sum(
        bend * shape * [1.0, (-1.0) ** j]
        for j, (bend, shape) in enumerate(zip(bends, shapes, strict=True))
    )


def _cycle(*bends: float) -> np.ndarray:
    """Returns a wave (100, 2) with harmonics."""
    phi = np.arange(100)[:, None] / 100 * 2 * np.pi
    shapes = [np.cos((j + 2) * phi + [0.0, j]) / (j + 1) for j in range(len(bends))]
    return np.sin(phi + [0.0, 1.0]) + sum(bend * x for bend, x in zip(bends, shapes, strict=True))


@pytest.mark.parametrize("noise", [0.0, 0.001, 0.005, 0.02])
@pytest.mark.parametrize("n_demos", [20, 60, 200])
@pytest.mark.parametrize("kind", ["discrete", "rhythmic"])
def test_styles_end_at_the_noise(kind: Any, n_demos: int, noise: float) -> None:
    """A mean and three styles give J = 4 for any number of demonstrations and level of noise."""
    random = np.random.default_rng(n_demos)
    make = _reach if kind == "discrete" else _cycle
    clean = [make(*bends) for bends in random.uniform(-0.3, 0.3, (n_demos, 3))]
    size = noise * np.ptp(clean[0])
    recorded = [x + size * random.normal(size=x.shape) for x in clean]
    model = pdmp.fit(recorded, dt=0.01, kind=kind, basis="ngnet")
    assert model.n_styles == 4
    assert model.noise == pytest.approx(size, rel=0.15)


@pytest.mark.parametrize("noise", [0.001, 0.005, 0.02])
def test_styles_end_at_noise_that_was_resampled(noise: float) -> None:
    """Recordings that were resampled from half the rate or less give the same J."""
    random = np.random.default_rng(5)
    clean = [_reach(*bends) for bends in random.uniform(-0.3, 0.3, (40, 3))]
    recorded = [x + noise * np.ptp(clean[0]) * random.normal(size=x.shape) for x in clean]
    for dt in (0.005, 0.002):
        demos = [pdmp.preprocessing.resample(pdmp.Demonstration(x, dt=0.01), dt) for x in recorded]
        assert pdmp.fit(demos, basis="ngnet").n_styles == 4


@pytest.mark.parametrize("seed", range(3))
def test_repetitions_of_one_movement_are_one_style(seed: int) -> None:
    """A hundred noisy recordings of one reach give J = 1 and its peak acceleration."""
    random = np.random.default_rng(seed)
    clean = _reach()
    recorded = [clean + 0.003 * random.normal(size=clean.shape) for _ in range(100)]
    model = pdmp.fit(recorded, dt=0.01)
    assert model.n_styles == 1
    peak = np.abs(pdmp.fit([clean], dt=0.01).rollout().acceleration).max()
    for m in range(0, 100, 20):
        made = model.rollout(model.conditions(m))
        assert np.abs(made.acceleration).max() < 1.3 * peak


def test_noise_does_not_accelerate_a_joint_at_rest() -> None:
    """Noise of half a milliradian accelerates a joint at rest by less than 1 rad/s²."""
    random = np.random.default_rng(0)
    clean = _reach() * [1.0, 0.0]
    recorded = [clean + 5e-4 * random.normal(size=clean.shape) for _ in range(5)]
    model = pdmp.fit(recorded, dt=0.01)
    for m in range(5):
        made = model.rollout(model.conditions(m))
        assert np.abs(made.acceleration[:, 1]).max() < 1.0
    kicked = pdmp.fit(recorded, dt=0.01, smoothing=None)
    assert np.abs(kicked.rollout(kicked.conditions(0)).acceleration[:, 1]).max() > 10


def test_layout_of_noisy_arrays_does_not_matter() -> None:
    """Noisy arrays in C and Fortran order give the same model bit for bit."""
    random = np.random.default_rng(4)
    recorded = [_reach(0.1) + 0.003 * random.normal(size=(101, 2)) for _ in range(6)]
    by_rows = pdmp.fit(recorded, dt=0.01)
    by_columns = pdmp.fit([np.asfortranarray(x) for x in recorded], dt=0.01)
    assert np.all(by_rows.noise > 0) and by_rows.to_bytes() == by_columns.to_bytes()


def test_noisy_movements_start_and_end_as_recorded() -> None:
    """Movements from and to rest have no velocity there in spite of noise; others keep theirs."""
    random = np.random.default_rng(8)
    time = np.linspace(0, 1, 201)
    sizes = np.linspace(0.7, 1.3, 8)

    def velocity(curve: Any) -> tuple[Any, Any, float]:
        demos = [
            Demonstration(
                np.outer(curve(time), [size, 2 - size]) + 0.003 * random.standard_normal((201, 2)),
                dt=0.005,
            )
            for size in sizes
        ]
        made = pdmp.fit(demos).rollout(dt=0.005).velocity
        return made[0], made[-1], np.abs(made).max()

    first, last, peak = velocity(lambda t: np.sin(np.pi * t / 2) ** 2)
    assert max(np.abs(first).max(), np.abs(last).max()) < 0.01 * peak
    first, last, peak = velocity(lambda t: np.sin(np.pi / 2 * (0.2 + 0.8 * t)))
    np.testing.assert_allclose(first, np.pi / 2 * 0.8 * np.cos(np.pi / 10), rtol=0.1)
    assert np.abs(last).max() < 0.02 * peak


def test_clean_demonstrations_are_not_smoothed() -> None:
    """Automatic smoothing does not change a model of clean demonstrations."""
    clean = [_reach(bend) for bend in (-0.2, 0.0, 0.1, 0.3)]
    models = [pdmp.fit(clean, dt=0.01, smoothing=x, n_styles=2) for x in ("auto", None)]
    assert models[0].to_bytes() == models[1].to_bytes()
    assert np.all(np.isinf(models[0].cut_offs)) and not np.any(models[0].noise)


def test_small_effects_of_a_context_are_kept() -> None:
    """The styles include small effects of a context beside larger random variation."""
    random = np.random.default_rng(1)
    heights = np.linspace(0, 0.02, 24)
    others = random.uniform(-1, 1, (24, 6))
    demos = [_reach(*other, height) for height, other in zip(heights, others, strict=True)]
    plain = pdmp.fit(demos, dt=0.01)
    model = pdmp.fit(demos, dt=0.01, contexts=heights[:, None])
    assert plain.n_styles < model.n_styles == 8


def test_degrees_of_freedom_in_different_units_weigh_alike() -> None:
    """Effects in rad beside mm are kept; small ranges in the same unit stay small."""
    s = np.linspace(0, 1, 101)
    rise, bump = s**3 * (10 - 15 * s + 6 * s**2), (4 * s * (1 - s)) ** 3
    turns = np.linspace(-1, 1, 8)
    demos = [
        pdmp.Demonstration(
            np.column_stack([400 * rise, 4 * bump, turn * bump]), dt=0.01, units=["mm", "mm", "rad"]
        )
        for turn in turns
    ]
    model = pdmp.fit(demos, singular_value_share=0.9)
    assert model.dof_scale == pytest.approx([400, 400, np.ptp(demos[0].position[:, 2])], rel=1e-3)
    made = model.rollout(model.conditions(7))
    assert made.position[:, 2].max() == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(("hz", "gain"), [(5.0, 1 / (1 + 4**4)), (20.0, 0.5), (80.0, 1.0)])
def test_cut_off_damps_as_stated(hz: float, gain: float) -> None:
    """The gain for a tremor of 20 Hz is 1/(1 + (f/f_c)⁴), one half at the cut-off."""
    t = np.arange(401) / 200
    tremor = np.sin(2 * np.pi * 20 * t)
    s = t / 2
    rise = s**3 * (10 - 15 * s + 6 * s**2)
    model = pdmp.fit([(rise + 0.02 * tremor)[:, None]], dt=1 / 200, smoothing=hz)
    rest = model.rollout(dt=1 / 200).position[:, 0] - rise
    inner = slice(100, 301)
    found = 2 * np.mean(rest[inner] * tremor[inner]) / 0.02
    assert found == pytest.approx(gain, abs=0.03)


def test_noise_that_is_large_is_reported() -> None:
    """Noise of a tenth of the range is reported; half a percent is smoothed silently."""
    random = np.random.default_rng(0)
    clean = _reach()
    with pytest.warns(UserWarning, match=r'"y0" has measurement noise of standard deviation 0\.'):
        pdmp.fit([clean + 0.1 * random.normal(size=clean.shape) for _ in range(10)], dt=0.01)
    model = pdmp.fit([clean + 0.005 * random.normal(size=clean.shape) for _ in range(10)], dt=0.01)
    assert "measurement noise 0.004" in repr(model) or "measurement noise 0.005" in repr(model)


def test_noise_of_a_joint_that_hardly_moves_is_not_reported() -> None:
    """Noise of a joint with a ten-thousandth of the range of another one is silent."""
    random = np.random.default_rng(0)
    clean = _reach()[:, :1] * [1, 1e-4]

    def fit(units: list[str]) -> None:
        noisy = [clean + [0, 1e-5] * random.normal(size=clean.shape) for _ in range(10)]
        pdmp.fit([Demonstration(y, dt=0.01, units=units) for y in noisy])

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fit(["rad", "rad"])
    with pytest.warns(UserWarning, match=r'"y1" has measurement noise of standard deviation 0\.'):
        fit(["m", "rad"])


def test_small_degrees_of_freedom_that_are_left_out_are_reported() -> None:
    """Degrees of freedom with small numbers that the styles omit are reported."""
    random = np.random.default_rng(0)
    s = np.linspace(0, 1, 101)
    wave, bump = np.sin(2 * np.pi * s) ** 3, (4 * s * (1 - s)) ** 3
    demos = [
        np.column_stack([400 * far * wave, 0.2 * turn * bump])
        for far, turn in random.uniform(-1, 1, (12, 2))
    ]
    with pytest.warns(UserWarning, match=r'n_styles = 1 leaves out \d+ % of "y1"'):
        pdmp.fit(demos, dt=0.01, n_styles=1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pdmp.fit(demos, dt=0.01, n_styles=1, dof_scale="range")  # scaled already
    made = pdmp.fit(demos, dt=0.01)
    assert made.n_styles == 2
