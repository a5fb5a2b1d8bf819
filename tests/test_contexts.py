"""Maps from contexts to movements: their selection, covariance and extrapolation."""

import pickle
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pdmp
from pdmp import ContextMap, Demonstration

TIME = np.linspace(0, 1, 51)[:, None]
BASE = TIME**3 * (10 - 15 * TIME + 6 * TIME**2) * [1.0, 0.5]
BENDS = [(TIME * (1 - TIME)) ** 3 * [0.0, 64.0], np.sin(np.pi * TIME) ** 4 * [1.0, 0.0]]


def bent(first: float, second: float = 0.0) -> np.ndarray:
    """Returns a reach with two kinds of bends."""
    return BASE + first * BENDS[0] + second * BENDS[1]


def curved(heights: np.ndarray, **options: object) -> pdmp.Model:
    """Returns a model whose movements depend nonlinearly on the height."""
    movements = [bent(np.sin(3 * h), h**2) for h in heights]
    return pdmp.fit(movements, dt=0.02, contexts=heights[:, None], **options)


def test_auto_follows_nonlinear_relations() -> None:
    """At a height between the demonstrated ones, "auto" is accurate where the linear map fails."""
    heights = np.linspace(0, 1, 9)
    wanted = bent(np.sin(3 * 0.56), 0.56**2)
    off = {
        name: np.abs(curved(heights, map=name).rollout(context=[0.56], dt=0.02).position - wanted)
        for name in ("auto", "linear")
    }
    assert off["auto"].max() < 0.02 < 0.2 < off["linear"].max()


def test_auto_reports_its_selection() -> None:
    """A nonlinear relation selects the process, a linear one the line; the repr states why."""
    chosen = curved(np.linspace(0, 1, 9)).map
    assert chosen is not None and chosen.kind == "stacked"
    errors = dict(chosen.errors)
    assert set(errors) == {"stacked", "gp", "linear"}
    assert errors["stacked"] <= 1.01 * errors["gp"] < 0.2 * errors["linear"]
    assert "Gaussian process and line" in repr(chosen) and "leave-one-out error" in repr(chosen)
    assert "interpolation weights 1.00 and 0.00" in repr(chosen)
    heights = np.linspace(0, 1, 9)[:, None]
    line = pdmp.ContextMap(heights, heights * [1.0, -2.0])
    assert "interpolation weights 0.00 and 1.00" in repr(line)


MASSES, SIDES = np.linspace(0.1, 0.6, 6), ["left", "right"] * 3


def named(contexts: Any) -> pdmp.Model:
    """Returns a model of contexts with a mass and a side."""
    demos = [bent(m, 0.3 * (side == "left")) for m, side in zip(MASSES, SIDES, strict=True)]
    return pdmp.fit(demos, dt=0.02, contexts=contexts)


def pandas_contexts() -> Any:
    """Returns the contexts as a data frame."""
    return pytest.importorskip("pandas").DataFrame({"mass": MASSES, "side": SIDES})


NAMED: dict[str, Callable[[], Any]] = {
    "columns": lambda: {"mass": MASSES, "side": SIDES},
    "rows": lambda: [{"mass": m, "side": s} for m, s in zip(MASSES, SIDES, strict=True)],
    "mixed rows": lambda: [
        {"mass": m, "side": s} if s == "left" else {"side": s, "mass": m}
        for m, s in zip(MASSES, SIDES, strict=True)
    ],
    "records": lambda: np.array(
        list(zip(MASSES, SIDES, strict=True)), [("mass", float), ("side", "U5")]
    ),
    "frame": pandas_contexts,
}


@pytest.mark.parametrize("form", NAMED)
def test_names_of_contexts_are_kept_and_order_predictions(form: str, tmp_path: Path) -> None:
    """Each form of named contexts gives the model of unnamed ones, with names that files keep."""
    plain = named([[m, s] for m, s in zip(MASSES, SIDES, strict=True)])
    assert plain.context_names is None
    fitted = named(NAMED[form]())
    fitted.save(tmp_path / "model")
    expected = plain.predict([0.3, "right"]).conditions
    for model in (fitted, pdmp.load(tmp_path / "model"), pickle.loads(pickle.dumps(fitted))):
        assert model.context_names == ["mass", "side"]
        assert "mass from 0.1 to 0.6, side 'left' or 'right'" in repr(model)
        for context in ([0.3, "right"], {"mass": 0.3, "side": "right"}):
            assert model.predict(context).conditions == expected
        assert model.predict({"side": "right", "mass": 0.3}).conditions == expected
        turned = model.rollout(context={"side": "right", "mass": 0.3}).position
        np.testing.assert_array_equal(turned, plain.rollout(expected).position)
        batch = {"side": ["right", "left"], "mass": [0.3, 0.5]}
        (made,) = model.rollouts(context=batch, derivatives=0)
        (same,) = plain.rollouts(context=[[0.3, "right"], [0.5, "left"]], derivatives=0)
        np.testing.assert_array_equal(made, same)


def test_a_row_of_a_frame_is_a_context() -> None:
    """Rows of a data frame are contexts by name, frames with other columns first too."""
    frame = pandas_contexts()
    model = named(frame)
    expected = model.rollouts(context=frame, derivatives=0)[0]
    swapped = frame[["side", "mass"]]
    np.testing.assert_array_equal(model.rollouts(context=swapped, derivatives=0)[0], expected)
    assert (
        model.predict(swapped.iloc[2]).conditions == model.predict([MASSES[2], "left"]).conditions
    )


def test_errors_of_named_contexts_have_the_names() -> None:
    """Values and names that do not suit the columns are rejected with the names."""
    model, plain = named(NAMED["columns"]()), curved(np.linspace(0, 1, 5))
    for context, message in (
        ({"mass": 0.3}, "context has the names mass; expected one value for each of mass, side"),
        ({"mass": 0.3, "side": "left", "x": 1.0}, "context has the names mass, side, x; expected"),
        ({"mass": 0.3, "side": "up"}, r'context\["side"\] = "up": not demonstrated'),
        ({"mass": "heavy", "side": "left"}, r'context\["mass"\] = "heavy": a number is expected'),
        ([0.3, "up"], r'context\["side"\] = "up": not demonstrated'),
    ):
        with pytest.raises(ValueError, match=message):
            model.predict(context)
    with pytest.raises(
        ValueError, match="context has names, but the contexts of the demonstration"
    ):
        plain.predict({"height": 0.2})
    for contexts, message in (
        ({"mass": MASSES, "side": SIDES[:3]}, "contexts: columns of different lengths"),
        (
            [{"mass": 0.1}] * 5 + [{"side": 0.1}],
            r"contexts\[5\]: expected one value for each of mass",
        ),
        ({"mass": MASSES[:5]}, "contexts has length 5, expected 6"),
        ({"m" * 1001: MASSES}, r'context_names\[0\] = "m+": must have at most 1000'),
    ):
        with pytest.raises(ValueError, match=message):
            named(contexts)
    with pytest.raises(TypeError, match="context is a mapping: pass its values in a list"):
        Demonstration(bent(0.1), dt=0.02, context={"mass": 0.1})


def test_labels_alone_give_the_mean_of_their_demonstrations() -> None:
    """The prediction for a label is the mean of its demonstrations, for any number of labels."""
    random = np.random.default_rng(2)
    bends = {name: k / 5 for k, name in enumerate("abcdef")}
    labels = [name for name in bends for _ in range(4)]
    offsets = 0.01 * random.normal(size=len(labels))
    demos = [bent(bends[name] + off) for name, off in zip(labels, offsets, strict=True)]
    model = pdmp.fit(demos, dt=0.02, contexts=[[name] for name in labels])
    for name, bend in bends.items():
        rows = [m for m, label in enumerate(labels) if label == name]
        found = model.predict([name])
        np.testing.assert_allclose(
            found.conditions.style, model.styles[rows].mean(axis=0), atol=1e-12
        )
        wanted = bent(bend + offsets[rows].mean())
        np.testing.assert_allclose(
            model.rollout(context=[name], dt=0.02).position, wanted, atol=1e-3
        )


def test_three_contexts_without_effect_do_not_make_a_line() -> None:
    """For random movements, errors of predictions are at most twice those of the mean."""
    random = np.random.default_rng(0)
    off, off_mean = [], []
    for _ in range(20):
        bends = random.normal(size=4)
        model = pdmp.fit([bent(b) for b in bends[:3]], dt=0.02, contexts=[[0.0], [0.5], [1.0]])
        made = model.rollout(context=[1.3], dt=0.02).position[:51]
        off.append(np.square(made - bent(bends[3])).mean())
        off_mean.append(np.square(bent(bends[:3].mean()) - bent(bends[3])).mean())
    assert np.mean(off) < 1.3 * np.mean(off_mean)


def test_predicted_durations_stay_near_those_of_the_demonstrations() -> None:
    """Far outside, predicted durations exceed the demonstrated range at most threefold."""
    movements = [
        pdmp.Demonstration(bent(0.1 * k), dt=0.02 * np.exp(0.3 * k), context=[k]) for k in range(6)
    ]
    for name in ("linear", "auto"):
        model = pdmp.fit(movements, map=name)
        low, high = model.durations.min(), model.durations.max()
        for far in (-1e3, 1e3):
            assert low / 3 * 0.999 < model.predict([far]).duration < high * 3.001


@pytest.mark.parametrize("name", ["linear", "polynomial", "gp", "stacked", "auto"])
def test_models_with_a_map_survive_a_file(name: str, tmp_path: pytest.TempPathFactory) -> None:
    """Predictions of a loaded or unpickled model equal those of the original bit for bit."""
    model = curved(np.linspace(0, 1, 7), map=name)
    model.save(tmp_path / "model.safetensors")
    for other in (pdmp.load(tmp_path / "model.safetensors"), pickle.loads(pickle.dumps(model))):
        a, b = model.predict([0.4]), other.predict([0.4])
        np.testing.assert_array_equal(a.conditions.style, b.conditions.style)
        np.testing.assert_array_equal(a.covariance, b.covariance)
        for bound, same in zip(model.band([0.4]), other.band([0.4]), strict=True):
            np.testing.assert_array_equal(bound, same)
        assert repr(model.map) == repr(other.map)


def labelled() -> pdmp.Model:
    """Returns a model of two labelled manners, each at several heights."""
    demos = [
        Demonstration(bent(height, lean), dt=0.02, context=[manner, height])
        for manner, lean in (("proud", 0.8), ("tired", -0.8))
        for height in (0.1, 0.3, 0.5, 0.7)
    ]
    return pdmp.fit(demos, map="linear", singular_value_share=0.999)


def test_labels_and_numbers_are_combined() -> None:
    """A combination of label and height that was not demonstrated is predicted."""
    made = labelled().rollout(context=["tired", 0.6], dt=0.02).position
    np.testing.assert_allclose(made, bent(0.6, -0.8), atol=1e-3)


def test_labels_are_returned_by_name() -> None:
    """Models and demonstrations return labels by name."""
    model = labelled()
    assert model.contexts[0] == ["proud", 0.1]
    demo = Demonstration(BASE, dt=0.02, context=["proud", 0.1])
    assert pickle.loads(pickle.dumps(demo)).context == ["proud", 0.1]
    assert "context ['proud', 0.1]" in repr(demo)


@pytest.mark.parametrize(
    ("context", "message"),
    [
        (["shy", 0.1], r'context\[0\] = "shy": not demonstrated; the labels are proud, tired'),
        ([1.0, 0.1], r"context\[0\] = 1: not demonstrated"),
        (["proud", "high"], r'context\[1\] = "high": a number is expected'),
        (["proud"], "context has length 1, expected 2"),
        (["proud", np.nan], r"context\[1\] = NaN"),
    ],
)
def test_unknown_labels_are_rejected(context: list[object], message: str) -> None:
    """An unknown label is rejected with the list of known ones."""
    with pytest.raises(ValueError, match=message):
        labelled().predict(context)


def test_labels_and_numbers_do_not_mix_in_a_column() -> None:
    """A context value is a label in all demonstrations or in none."""
    with pytest.raises(ValueError, match=r"contexts\[:, 0\] holds 1 label and 2 numbers"):
        pdmp.fit([BASE] * 3, dt=0.02, contexts=[[0.1], ["high"], [0.2]])


def test_contexts_far_away_are_flagged() -> None:
    """The extrapolation of a context is in units of the demonstrated range."""
    model = curved(np.linspace(0.2, 0.7, 6))
    np.testing.assert_allclose(model.predict([0.45]).extrapolation, [0.0])
    found = model.predict([1.7])
    np.testing.assert_allclose(found.extrapolation, [2.0])
    assert "extrapolated by 2.00 of the demonstrated range of contexts" in repr(found)


def test_band_widens_gradually_beyond_the_contexts() -> None:
    """It is narrow one and seven per cent of the range beyond contexts that say all."""
    rng = np.random.default_rng(5)
    heights = np.linspace(0.2, 0.7, 8)
    movements = [bent(h) + 0.002 * rng.normal(size=bent(h).shape) for h in heights]
    model = pdmp.fit(movements, dt=0.02, contexts=heights[:, None])

    def half_width(height: float) -> float:
        lower, upper = model.band([height], dt=0.02)
        return float((upper - lower).max() / 2)

    border = half_width(0.2)
    assert half_width(0.2 - 1e-9) < 1.001 * border
    assert half_width(0.195) < 1.5 * border
    assert half_width(0.165) < 4 * border
    lower, upper = model.band([0.165], dt=0.02)
    assert np.mean((lower <= bent(0.165)) & (bent(0.165) <= upper)) > 0.9
    assert half_width(-0.3) > 10 * border


def test_movements_far_outside_the_contexts_are_reported() -> None:
    """Each way to a movement warns beyond a tenth of the demonstrated range, and not before."""
    model = curved(np.linspace(0.2, 0.7, 6))
    controller = model.controller()
    ways = (
        lambda h: model.rollout(context=[h]),
        lambda h: model.controller(context=[h]),
        lambda h: controller.reset(context=[h]),
        lambda h: model.rollouts(context=[[0.3], [h]]),
        lambda h: model.controllers(2, context=[[0.3], [h]]),
    )
    for way in ways:
        with pytest.warns(UserWarning, match=r"context\[0\] = 1.7 lies outside .* by 2.00 times"):
            way(1.7)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            for height in (0.2, 0.7, 0.74, 0.16):
                way(height)
    named = pdmp.fit([bent(b) for b in (0.2, 0.3)], dt=0.02, contexts={"height": [1.0, 1.0]})
    with pytest.warns(UserWarning, match=r'context\["height"\] = 2 differs from the only'):
        named.rollout(context={"height": 2.0})


def test_process_returns_to_its_mean_far_outside() -> None:
    """Far outside, the Gaussian process returns to its mean, with its full variance."""
    model = curved(np.linspace(0, 1, 12), map="gp")
    near, far = model.predict([0.5]), model.predict([100.0])
    np.testing.assert_allclose(
        far.conditions.style, model.predict([1000.0]).conditions.style, rtol=1e-9
    )
    assert np.all(np.diag(far.covariance)[:2] > 10 * np.diag(near.covariance)[:2])


def test_one_context_value_only_predicts_the_mean() -> None:
    """Repetitions of one condition predict their mean and scatter; another context is outside."""
    movements = [bent(b) for b in (0.2, 0.3, 0.4)]
    model = pdmp.fit(movements, dt=0.02, contexts=[[1.0]] * 3)
    found = model.predict([2.0])
    np.testing.assert_allclose(found.conditions.style, model.styles.mean(axis=0), atol=1e-12)
    assert np.isinf(found.extrapolation[0])


def test_band_covers_its_level() -> None:
    """A band of 0.9 contains nine tenths of the positions of new movements."""
    rng = np.random.default_rng(3)

    def noisy(height: float) -> np.ndarray:
        return bent(height + 0.1 * rng.normal(), 0.1 * rng.normal())

    inside = []
    for _ in range(12):
        heights = rng.uniform(0, 1, 14)
        movements = [noisy(h) for h in heights]
        model = pdmp.fit(movements, dt=0.02, contexts=heights[:, None])
        for height in (0.3, 0.5, 0.7):
            lower, upper = model.band([height], dt=0.02)
            new = noisy(height)
            moving = slice(10, 41)  # at the ends all movements are alike
            within = (lower <= new) & (new <= upper)
            inside.append(within[moving].mean())
    assert 0.82 < np.mean(inside) < 0.97


def test_band_surrounds_the_rollout_and_grows_with_its_level() -> None:
    """The bounds are symmetric about the predicted movement."""
    rng = np.random.default_rng(1)
    heights = np.linspace(0, 1, 9)
    movements = [bent(h + 0.05 * rng.normal(), 0.05 * rng.normal()) for h in heights]
    model = pdmp.fit(movements, dt=0.02, contexts=heights[:, None], n_styles=1)
    made = model.rollout(context=[0.4], dt=0.02).position
    narrow, wide = model.band([0.4], level=0.5, dt=0.02), model.band([0.4], level=0.99, dt=0.02)
    np.testing.assert_allclose((wide[0] + wide[1]) / 2, made, atol=1e-12)
    assert np.all(wide[1] - wide[0] >= narrow[1] - narrow[0])
    with pytest.raises(ValueError, match="level = 1: must lie between 0 and 1"):
        model.band([0.4], level=1.0)


def test_map_alone_agrees_with_least_squares() -> None:
    """The linear map equals least squares of numpy, in any units of the contexts."""
    rng = np.random.default_rng(0)
    contexts, outputs = rng.normal(size=(20, 3)) * [1, 1e3, 1e-3], rng.normal(size=(20, 2))
    design = np.column_stack([np.ones(20), contexts])
    expected = design @ np.linalg.lstsq(design, outputs, rcond=None)[0]
    found, covariance = ContextMap(contexts, outputs, "linear").predict(contexts)
    np.testing.assert_allclose(found, expected, atol=1e-10)
    assert covariance.shape == (20, 2, 2) and np.all(np.linalg.eigvalsh(covariance) > 0)


def test_map_agrees_with_scikit_learn() -> None:
    """With the same length and noise, the process equals that of scikit-learn."""
    gaussian = pytest.importorskip("sklearn.gaussian_process")
    kernels = gaussian.kernels
    contexts = np.linspace(0, 1, 15)[:, None]
    outputs = np.sin(6 * contexts) + 0.05 * np.cos(40 * contexts)
    found = ContextMap(contexts, outputs, "gp")
    spread = contexts.std()
    kernel = (
        kernels.ConstantKernel(1e4)
        + kernels.ConstantKernel(1.0) * kernels.Matern(length_scale=spread, nu=2.5)
        + kernels.WhiteKernel(0.01)
    )
    peer = gaussian.GaussianProcessRegressor(kernel, n_restarts_optimizer=2, random_state=0)
    peer.fit(contexts, outputs)
    at = np.linspace(0.1, 0.9, 9)[:, None]
    np.testing.assert_allclose(found.predict(at)[0][:, 0], peer.predict(at).ravel(), atol=0.05)


def scattered(rng: np.random.Generator, n: int = 16) -> tuple[list[np.ndarray], np.ndarray]:
    """Returns movements with two bends that depend on the height, and three random ones."""
    heights = rng.uniform(0, 1, n)
    chance = [np.sin(k * np.pi * TIME) ** 2 * [1.0, (-1.0) ** k] for k in (3, 4, 5)]
    movements = [
        bent(np.sin(3 * h), h**2) + sum(0.02 * rng.normal() * shape for shape in chance)
        for h in heights
    ]
    return movements, heights[:, None]


def test_number_of_styles_is_that_explained_by_contexts() -> None:
    """Cross-validation omits variation that contexts do not explain; singular values cannot."""
    rng = np.random.default_rng(2)
    few, many = [], []
    for _ in range(9):
        movements, heights = scattered(rng)
        # With immediate transport, the mean movement adds a dimension to those of the heights.
        options = {"dt": 0.02, "contexts": heights, "transport": "immediate"}
        few.append(pdmp.fit(movements, n_styles="auto", **options).n_styles)
        many.append(pdmp.fit(movements, singular_value_share=0.99, **options).n_styles)
    assert np.median(few) < np.median(many)


@pytest.mark.parametrize("kind", ["discrete", "rhythmic"])
def test_styles_are_those_of_cross_validation(kind: str) -> None:
    """Models fitted without each fold in turn select the same number."""
    rng = np.random.default_rng(4)
    movements, heights = scattered(rng, 10)
    if kind == "rhythmic":
        movements = [(m - m.mean(axis=0))[:-1] * np.sin(np.pi * TIME[:-1]) for m in movements]
    options = {"kind": kind, "dt": 0.02, "map": "linear", "alpha_z": 25.0}
    errors = np.empty((10, 9))
    for m, height in enumerate(heights):
        kept = [k for k in range(10) if k != m]
        for j in range(9):
            model = pdmp.fit(
                [movements[k] for k in kept],
                contexts=heights[kept],
                n_styles=j + 1,
                nominal=0,
                **options,
            )
            made = model.rollout(context=height, dt=0.02).position[: len(movements[m])]
            errors[m, j] = ((made - movements[m]) ** 2).sum(axis=1).mean()
    best = errors.mean(axis=0).argmin()
    more = errors - errors[:, [best]]
    close = more.mean(axis=0) <= more.std(axis=0, ddof=1) / np.sqrt(10)
    found = pdmp.fit(movements, contexts=heights, n_styles="auto", nominal=0, **options)
    assert found.n_styles == 1 + close.argmax()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"n_styles": "auto"}, "n_styles needs contexts"),
        (
            {"n_styles": "auto", "contexts": [[0.0], [0.0], [1.0]]},
            "n_styles needs at least three different contexts",
        ),
        ({"n_styles": "most"}, 'n_styles = .most.: must be a number, "auto" or None'),
    ],
)
def test_selection_without_varying_contexts_is_rejected(
    options: dict[str, object], message: str
) -> None:
    """Selection by cross-validation needs contexts that vary."""
    with pytest.raises(ValueError, match=message):
        pdmp.fit([bent(0.1), bent(0.2), bent(0.3)], dt=0.02, **options)


@pytest.mark.parametrize("as_contexts", [list, np.array, lambda h: [[x] for x in h]])
def test_single_context_values_need_no_list(as_contexts: Any) -> None:
    """One number for each demonstration is one context value, in a fit as in its prediction."""
    heights = [0.0, 0.2, 0.4, 0.6]
    demos = [bent(h) for h in heights]
    model = pdmp.fit(demos, dt=0.02, contexts=as_contexts(heights))
    np.testing.assert_array_equal(model.contexts, np.array(heights)[:, None])
    labelled = pdmp.fit(demos, dt=0.02, contexts=["a", "b", "a", "b"])
    assert labelled.contexts == [["a"], ["b"], ["a"], ["b"]]
    with pytest.raises(TypeError, match=r"contexts must be an array of shape \(M, Q\) or \(M,\)"):
        pdmp.fit(demos, dt=0.02, contexts="abab")


def test_evaluate_takes_the_contexts_of_fit() -> None:
    """Names and single values are read as by a fit."""
    heights = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]
    demos = [bent(h) for h in heights]
    forms = [heights, {"height": heights}, [{"height": h} for h in heights], [[h] for h in heights]]
    errors = [pdmp.evaluate(demos, dt=0.02, contexts=form, max_folds=2) for form in forms]
    assert len({str(one) for one in errors}) == 1
