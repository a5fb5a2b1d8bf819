"""Evaluation of predictions of held-out movements, with the measures of the paper."""

import re
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import pdmp
from pdmp.evaluation import (
    PDMP,
    Components,
    Evaluation,
    Forecast,
    LinearWeights,
    MovedGoal,
    NearestDemonstration,
    Recordings,
    baselines,
)
from pdmp.evaluation.splits import within_hull
from report.baselines import library_baselines
from synthetic import loops, reaches

HEIGHTS = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]
CONTEXTS = [[height] for height in HEIGHTS]


def arches(heights: list[float], noise: float = 0.0) -> list[np.ndarray]:
    """Returns planar movements (101, 2) that are linear in their height."""
    s = np.linspace(0, 1, 101)
    random = np.random.default_rng(0)
    reach = s**3 * (10 - 15 * s + 6 * s**2)
    arch = 64 * (s * (1 - s)) ** 3
    clean = [np.column_stack([(1 + h) * reach + h, h * arch]) for h in heights]
    return [position + noise * random.standard_normal(position.shape) for position in clean]


class Known:
    """A predictor with the true movements and a given standard deviation."""

    def __init__(self, deviation: float | None = None) -> None:
        self.deviation = deviation

    def fit(self, recordings: Recordings) -> Any:
        """Returns the true movements."""

        def predict(context: np.ndarray) -> Forecast:
            (position,) = arches([context[0]])
            variance = None if self.deviation is None else np.full_like(position, self.deviation**2)
            return Forecast(position, 1.0, variance)

        return predict


def evaluated(predictors: dict[str, Any], heights: list[float] = HEIGHTS, **options: Any) -> Any:
    """Returns an evaluation of predictors on arches."""
    noise = options.pop("noise", 0.0)
    contexts = [[height] for height in heights]
    demos = arches(heights, noise)
    return pdmp.evaluate(demos, dt=0.01, contexts=contexts, predictors=predictors, **options)


def test_perfect_forecasts_have_no_error() -> None:
    """Perfect forecasts have zero E, deviation and duration error."""
    found = evaluated({"known": Known()}).summary("known")
    assert (found.error, found.deviation, found.relative) == (0, 0, 0)
    assert found.duration < 1e-12


def test_error_is_the_papers() -> None:
    """A forecast with an error of (a, b) at every sample has E = a² + b²."""

    class Off(Known):
        def fit(self, recordings: Recordings) -> Any:
            predict = super().fit(recordings)
            return lambda context: Forecast(predict(context).position + [0.3, -0.4], 2.0)

    found = evaluated({"off": Off()}).summary("off")
    assert found.error == pytest.approx(0.25)
    assert found.duration == pytest.approx(1.0)


def test_mean_demonstration_is_the_reference() -> None:
    """The mean demonstration has a relative error of 1, and is always included."""
    found = evaluated({})
    for reach in found.reaches():
        summary = found.summary("mean demonstration", reach)
        assert (summary.relative, summary.relative_error) == (1, 0)


def test_linear_family_is_predicted() -> None:
    """Primitive and principal components predict exactly; a moved demonstration does not."""
    linear = {"PDMP": PDMP(n_styles=2), "PCA": LinearWeights(Components())}
    found = evaluated(linear | {"one": MovedGoal()})
    for name in linear:
        assert found.summary(name).relative < 1e-7
    assert found.summary("one").relative > 1e-3


def test_full_primitive_is_principal_components() -> None:
    """With J = M and a linear map, both are the same linear predictor of positions."""
    contexts = [[height**2] for height in HEIGHTS]
    full = PDMP(map="linear", singular_value_share=1.0, basis=pdmp.GP(noise=1e-10))
    pair = {"PDMP": full, "PCA": LinearWeights(Components(1.0))}
    found = pdmp.evaluate(arches(HEIGHTS), dt=0.01, contexts=contexts, predictors=pair)
    for ours, theirs in zip(*(found.forecasts[name] for name in pair), strict=True):
        for a, b in zip(ours, theirs, strict=True):
            np.testing.assert_allclose(a.position, b.position, atol=1e-5)
            # The band is Student's, of three degrees of freedom here.
            student = (2.35336 / 1.64485) ** 2
            np.testing.assert_allclose(a.variance, student * b.variance, atol=2e-6)
    assert found.summary("PCA").relative > 1e-3
    assert abs(found.compare("PDMP", "PCA").mean) < 1e-6


def test_both_maps_agree_for_collinear_contexts() -> None:
    """For two collinear contexts in other units, both maps predict the same."""
    contexts = [[height, 1000 * height] for height in HEIGHTS]
    pair = {"PDMP": PDMP(n_styles=2), "PCA": LinearWeights(Components())}
    found = pdmp.evaluate(arches(HEIGHTS), dt=0.01, contexts=contexts, predictors=pair)
    for name in pair:
        assert found.summary(name).relative < 1e-7


def test_band_of_known_width_covers_its_share() -> None:
    """With the true variance, the 90 % band contains nine tenths of the positions."""
    found = evaluated({"known": Known(0.05)}, noise=0.05)
    assert found.summary("known").coverage == pytest.approx(0.9, abs=0.03)


@pytest.mark.parametrize("name", ["PCA, linear map", "PDMP"])
def test_learnt_band_covers_its_share(name: str) -> None:
    """The variance from residuals is about that of a new movement."""
    heights = list(np.linspace(0, 0.5, 40))
    found = evaluated({name: (baselines() | {"PDMP": PDMP()})[name]}, heights, noise=0.02)
    assert found.summary(name).coverage == pytest.approx(0.9, abs=0.07)


def test_each_condition_is_held_out_once() -> None:
    """Conditions are held out as a whole; the two outermost are extrapolation."""
    found = evaluated({}, [*HEIGHTS, *HEIGHTS])
    assert [split.reach for split in found.splits] == (
        ["extrapolation"] + ["interpolation"] * 4 + ["extrapolation"]
    )
    for k, split in enumerate(found.splits):
        assert split.test.tolist() == [k, k + 6]
        assert sorted([*split.train, *split.test]) == list(range(12))


def test_many_conditions_are_held_out_with_their_neighbours() -> None:
    """There are max_folds folds at most, each an interval."""
    heights = list(np.random.default_rng(0).permutation(100) / 200)
    found = evaluated({}, heights, max_folds=7)
    assert len(found.splits) == 7
    for split in found.splits:
        inside = found.recordings.contexts[split.test]
        others = found.recordings.contexts[split.train]
        assert not np.any((others > inside.min()) & (others < inside.max()))


def test_hull_separates_interpolation_from_extrapolation() -> None:
    """A point inside the hull is interpolation, and one outside an edge extrapolation."""
    corners = np.array([[0.0, 0.0], [100.0, 0.0], [0.0, 1.0]])
    for point, expected in (([30, 0.3], True), ([0, 1], True), ([50, 0.5], True)):
        assert within_hull(np.array(point, float), corners) == expected
    for point in ([51, 0.51], [-1, 0.5], [0, 1.01]):
        assert not within_hull(np.array(point, float), corners)


def test_splits_can_be_given() -> None:
    """Given splits are used, such as the paper's of three training conditions."""
    splits = [([0, 2, 3], [1], "interpolation"), ([0, 2, 3], [4, 5], "extrapolation")]
    found = evaluated({"nearest": NearestDemonstration()}, splits=splits)
    assert [found.summary("nearest", reach).n for reach in found.reaches()] == [1, 1]
    assert np.isnan(found.summary("nearest", "interpolation").standard_error)


def test_comparison_is_paired() -> None:
    """Differences are per split, with the standard error of their mean."""
    found = evaluated({"nearest": NearestDemonstration()})
    compared = found.compare("nearest", "mean demonstration")
    expected = found.score("nearest").error - found.score("mean demonstration").error
    np.testing.assert_array_equal(compared.differences, expected)
    assert compared.standard_error == pytest.approx(expected.std(ddof=1) / np.sqrt(6))


def test_cycles_are_predicted() -> None:
    """A primitive of loops predicts the loop between two others over phase."""
    contexts, tried = [[0.0], [0.5], [1.0]], {"PDMP": PDMP()}
    found = pdmp.evaluate(loops(), contexts=contexts, predictors=tried, kind="rhythmic")
    assert found.summary("PDMP", "interpolation").error < 1e-6
    assert found.recordings.durations == pytest.approx([2, 2, 2])


def test_contexts_of_demonstrations_are_used() -> None:
    """Contexts of demonstrations are the default."""
    found = pdmp.evaluate(reaches(), predictors={})
    np.testing.assert_allclose(found.recordings.contexts[:, 0], [-0.2, -0.1, 0, 0.1, 0.2])


def test_dt_keeps_the_units_of_demonstrations() -> None:
    """The argument dt keeps the other attributes of a demonstration without an interval."""
    demos = [pdmp.Demonstration(arch, units=["m", "m"]) for arch in arches(HEIGHTS)]
    found = pdmp.evaluate(demos, dt=0.01, contexts=CONTEXTS, predictors={})
    assert all(demo.units == ["m", "m"] for demo in found.recordings.demos)


def test_dt_is_that_of_demonstrations_without_one() -> None:
    """Bare arrays and demonstrations without an interval give the same results."""
    bare, held = arches(HEIGHTS), [pdmp.Demonstration(one) for one in arches(HEIGHTS)]
    options = {"dt": 0.01, "contexts": CONTEXTS, "predictors": {"PDMP": PDMP(n_styles=2)}}
    scores = [pdmp.evaluate(demos, **options).score("PDMP").error for demos in (bare, held)]
    np.testing.assert_array_equal(*scores)


@pytest.fixture(scope="module")
def found() -> Evaluation:
    """Returns an evaluation of all default predictors."""
    return pdmp.evaluate(reaches())


def test_evaluation_prints_a_table(found: Evaluation) -> None:
    """Each predictor has a line per reach, as text and as Markdown."""
    for text in (repr(found), found.markdown()):
        assert re.search("interpolation: 3 folds, 3 demonstrations", text)
        for name in found.scores:
            assert len(re.findall(rf"^\W*{name}\b", text, re.MULTILINE)) == 2


def test_missing_library_leaves_its_predictor_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other predictors are evaluated, and the reason is reported."""
    monkeypatch.setitem(sys.modules, "sklearn.gaussian_process", None)
    found = pdmp.evaluate(reaches(), predictors=library_baselines() | {"PDMP": PDMP()})
    assert "PDMP" in found.scores
    assert "left out: PCA, Gaussian processes: scikit-learn is not installed" in repr(found)


@pytest.mark.parametrize("name", ["evaluate", "io", "plot", "preprocessing"])
def test_modules_are_imported_at_first_use(name: str) -> None:
    """Importing the package imports no module that a control loop does not need."""
    module = f"pdmp.{name}".replace("evaluate", "evaluation")
    code = (
        f"import sys, pdmp; assert '{module}' not in sys.modules; "
        f"pdmp.{name}; assert '{module}' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


CYCLES: list[tuple[dict[str, Any], str]] = [
    ({}, "demo 0: a time-stamped cycle: pass period= in seconds"),
    ({"period": 1.0}, "demo 0: period = 1: must exceed the last time stamp, 1 s"),
    ({"period": [2.0] * 5}, "period has length 5, expected 6: one value per demonstration"),
]
BAD: list[tuple[dict[str, Any], str]] = [
    ({"contexts": None}, "demo 0 has no context: pass contexts="),
    ({"contexts": CONTEXTS[:4]}, "contexts has length 4, expected 6: one value per demonstration"),
    ({"contexts": [*CONTEXTS[:5], [1.0, 2.0]]}, "contexts differ in length"),
    ({"contexts": [*CONTEXTS[:5], [np.nan]]}, r"contexts\[5, 0\] = nan: must be finite"),
    ({"contexts": [[1.0]] * 6}, "contexts: one condition in 6 demonstrations: at least 2"),
    ({"max_folds": 1}, "max_folds = 1: must be at least 2"),
    ({"n_samples": 3}, "n_samples = 3: must be at least 4"),
    ({"kind": "circular"}, 'kind = .circular.: must be "discrete" or "rhythmic"'),
    ({"period": 1.0}, "period does not apply to discrete"),
    ({"dt": None}, "dt is missing: pass the sampling interval in seconds"),
    ({"splits": []}, "splits is empty"),
    ({"splits": [([0], [1])]}, r"splits\[0\]: must be \(train, test,"),
    ({"splits": [([0], [], "interpolation")]}, r"splits\[0\]: test must be one or more indices"),
    ({"splits": [([0, 6], [1], "interpolation")]}, r"train index 6 must lie between 0 and 5"),
    ({"splits": [([0], [-1], "interpolation")]}, r"test index -1 must lie between 0 and 5"),
    ({"splits": [([0, 1], [1], "interpolation")]}, r"demonstration 1 is in train and in test"),
]


@pytest.mark.parametrize(("option", "message"), BAD, ids=str)
def test_invalid_input_is_rejected(option: dict[str, Any], message: str) -> None:
    """Errors name the argument, the numbers and the remedy."""
    with pytest.raises(ValueError, match=message):
        pdmp.evaluate(arches(HEIGHTS), **({"dt": 0.01, "contexts": CONTEXTS} | option))


@pytest.mark.parametrize(("option", "message"), CYCLES, ids=str)
def test_invalid_periods_are_rejected(option: dict[str, Any], message: str) -> None:
    """Cycles with time stamps need a period beyond the last stamp."""
    stamped = [pdmp.Demonstration(one, time=np.linspace(0, 1, 101)) for one in arches(HEIGHTS)]
    with pytest.raises(ValueError, match=message):
        pdmp.evaluate(stamped, kind="rhythmic", contexts=CONTEXTS, **option)


def test_forecast_of_another_shape_is_rejected() -> None:
    """A forecast of a wrong shape is rejected with the expected shape."""

    class Short(Known):
        def fit(self, recordings: Recordings) -> Any:
            return lambda context: Forecast(np.zeros((5, 2)), 1.0)

    with pytest.raises(ValueError, match=r"'short' predicts positions of shape \(5, 2\), expected"):
        evaluated({"short": Short()})


@pytest.mark.parametrize(
    ("forecast", "message"),
    [
        (Forecast(np.full((101, 2), np.nan), 1.0), "predicts a position that is not finite"),
        (
            Forecast(np.zeros((101, 2)), 1.0, np.zeros((101, 1))),
            r"predicts variances of shape \(101, 1\)",
        ),
        ((np.zeros((101, 2)), 1.0), "returns a tuple, expected an evaluation.Forecast"),
    ],
)
def test_invalid_forecasts_are_rejected(forecast: Any, message: str) -> None:
    """Forecasts are checked for type and finite numbers."""

    class Given(Known):
        def fit(self, recordings: Recordings) -> Any:
            return lambda context: forecast

    with pytest.raises(ValueError, match=f"'given' {message}"):
        evaluated({"given": Given()})


def test_progress_is_reported_and_can_end_the_evaluation() -> None:
    """Progress has predictors and rising fractions; exceptions of the callback propagate."""
    reported: list[tuple[str, float]] = []
    evaluated({"known": Known()}, progress=lambda *at: reported.append(at))
    assert list(dict(reported)) == ["mean demonstration", "known"]
    shares = [share for _, share in reported]
    assert shares == sorted(shares) and shares[0] == 0 and shares[-1] < 1

    def stop(name: str, share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        evaluated({"known": Known()}, progress=stop)


def test_reference_keeps_its_name() -> None:
    """The reference predictor cannot be replaced."""
    with pytest.raises(ValueError, match="'mean demonstration' is always included"):
        evaluated({"mean demonstration": Known()})


def test_unknown_names_are_rejected(found: Evaluation) -> None:
    """Unknown predictors and reaches are rejected with the available ones."""
    with pytest.raises(ValueError, match="predictor = 'none': must be one of mean demonstration, "):
        found.summary("none")
    with pytest.raises(ValueError, match='reach = "nowhere"'):
        found.summary("PDMP", "nowhere")


def mannered() -> tuple[list[np.ndarray], list[list[float | str]]]:
    """Returns movements of two manners, each at several heights."""
    contexts = [[manner, h] for manner in ("proud", "tired") for h in HEIGHTS]
    lean = {"proud": 0.5, "tired": -0.5}
    bow = np.sin(np.pi * np.linspace(0, 1, 101))[:, None] ** 3 * [0.0, 1.0]
    movements = [arches([h])[0] + lean[manner] * bow for manner, h in contexts]
    return movements, contexts


def test_labels_are_conditions_too() -> None:
    """Labels beside numbers are contexts for primitives and all baselines."""
    movements, contexts = mannered()
    predictors = baselines() | library_baselines()
    predictors["PDMP"] = PDMP(map="linear", singular_value_share=0.999)
    found = pdmp.evaluate(movements, contexts=contexts, dt=0.01, predictors=predictors)
    assert {split.reach for split in found.splits} == {"interpolation", "extrapolation"}
    assert sum(len(split.test) for split in found.splits) == len(movements)
    for name in ("PDMP", "PCA, linear map"):
        assert found.summary(name, "interpolation").relative < 1e-4
    for name in ("nearest demonstration", "PCA, Gaussian processes"):
        assert name in found.skipped or found.summary(name, "interpolation").relative < 0.3


def test_labels_without_training_demonstrations_are_rejected() -> None:
    """A label without a training demonstration is rejected."""
    movements, contexts = mannered()
    manners = [[manner] for manner, _ in contexts]
    with pytest.raises(ValueError, match="has no training demonstration"):
        pdmp.evaluate(movements, contexts=manners, dt=0.01)
    mixed = [[0.1], *manners[1:]]
    with pytest.raises(ValueError, match=r"contexts\[:, 0\] holds 11 labels and 1 number:"):
        pdmp.evaluate(movements, contexts=mixed, dt=0.01)
