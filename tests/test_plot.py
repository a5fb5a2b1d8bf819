"""Contents of figures, on axes with quantity and unit."""

import sys
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cycler import cycler
from matplotlib import rc_context
from matplotlib.figure import Figure

import pdmp
from pdmp import plot
from pdmp.evaluation import Evaluation, over_styles
from pdmp.plot.canvas import MAX_LABEL
from pdmp.preprocessing import Cycles
from synthetic import loops, reaches


@pytest.fixture(scope="module")
def model() -> pdmp.Model:
    """Returns a discrete model of five reaches."""
    return pdmp.fit(reaches(), n_styles=2)


@pytest.fixture(scope="module")
def rhythmic() -> pdmp.Model:
    """Returns a rhythmic model of three loops."""
    return pdmp.fit(loops(), kind="rhythmic", n_styles=2)


@pytest.fixture(scope="module")
def evaluation() -> Evaluation:
    """Returns an evaluation of primitives with one and two styles."""
    return pdmp.evaluate(reaches(), predictors=over_styles(2))


def labels_of(figure: Figure) -> set[str]:
    """Returns the labels of all axes."""
    return {text for axes in figure.axes for text in (axes.get_xlabel(), axes.get_ylabel())}


def test_demonstrations_are_drawn_with_reproductions(model: pdmp.Model) -> None:
    """The path panel has a line for each demonstration and for its reproduction."""
    figure = plot.demonstrations(model, reaches())
    assert len(figure.axes[0].lines) == 2 * model.n_demos
    assert labels_of(figure) == {"x [m]", "y [m]", "time [s]"}


def test_demonstrations_have_a_column_per_label(model: pdmp.Model) -> None:
    """Labels group the demonstrations in order of appearance."""
    figure = plot.demonstrations(model, reaches(), labels=["b", "b", "a", "a", "a"])
    assert [axes.get_title() for axes in figure.axes[:2]] == ["b", "a"]


@pytest.mark.parametrize("n_dofs", [1, 3])
def test_only_a_plane_has_a_path_panel(n_dofs: int) -> None:
    """One and three degrees of freedom are drawn over time only."""
    demos = [demo.position[:, [0, 1, 0][:n_dofs]] for demo in reaches()]
    figure = plot.demonstrations(
        pdmp.fit(demos, dt=0.02), [pdmp.Demonstration(demo, dt=0.02) for demo in demos]
    )
    assert len(figure.axes) == n_dofs


def test_demonstrations_must_be_those_of_the_fit(model: pdmp.Model) -> None:
    """A wrong number of demonstrations is rejected."""
    with pytest.raises(ValueError, match="4 recordings given, expected 5"):
        plot.demonstrations(model, reaches()[:4])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"position": reaches()[0].position[:, :1]}, "demo 0: expected 2 DoFs, found 1"),
        ({"position": reaches()[0].position, "names": ["y1", "y0"]}, "demo 0: names .* expected"),
        ({"position": reaches()[0].position, "units": ["mm", "m"]}, "demo 0: units .* expected"),
    ],
)
def test_demonstrations_have_the_dofs_of_the_model(
    model: pdmp.Model, given: dict[str, Any], message: str
) -> None:
    """Demonstrations with other degrees of freedom are rejected."""
    other = pdmp.Demonstration(given.pop("position"), dt=0.01, **given)
    with pytest.raises(ValueError, match=message):
        plot.demonstrations(model, [other] * model.n_demos)


@pytest.mark.parametrize(("units", "aspect"), [(["m", "m"], 1.0), (["mm", "rad"], "auto")])
def test_a_path_has_one_scale_if_the_units_agree(units: list[str], aspect: object) -> None:
    """Millimetres and radians at one scale are a line without height."""
    demos = [pdmp.Demonstration(demo.position, dt=0.01, units=units) for demo in reaches()]
    model = pdmp.fit(demos)
    for figure in (
        plot.demonstrations(model, demos),
        plot.fan(model, model.conditions(0), model.conditions(4)),
    ):
        assert figure.axes[0].get_aspect() == aspect


@pytest.mark.parametrize("n_dofs", [2, 3, 5])
def test_long_labels_are_inside_the_figure_and_apart(n_dofs: int) -> None:
    """Long names take several lines, broken between words, and never within a unit."""
    names = ["shoulder_pan_joint", "elbow_flexion_joint_left", "LEFT-WRIST-PITCH"][:n_dofs]
    names += ["observation.state.hand", "averyveryverylongname"][: n_dofs - len(names)]
    position = reaches()[0].position[:, [0, 1, 0, 1, 0][:n_dofs]]
    demo = pdmp.Demonstration(position, dt=0.01, names=names, units=["m/s.kg"] * n_dofs)
    model = pdmp.fit([demo])
    # At a low resolution, letters are wider.
    with rc_context({"figure.dpi": 80}):
        figures = [
            plot.demonstrations(model, [demo]),
            plot.fan(model, model.conditions(0), model.conditions(0)),
            plot.variation([demo]),
            plot.motion(model.rollout()),
        ]
    for figure in figures:
        figure.savefig(BytesIO())
        drawn = [axes for axes in figure.axes if axes.lines]
        for axes in drawn:
            lines = axes.get_ylabel().split("\n")
            assert max(map(len, lines)) <= MAX_LABEL
            assert "".join(lines).replace(" ", "").count("[m/s.kg") == 1
        boxes = [axes.yaxis.label.get_window_extent() for axes in drawn]
        assert all(box.y0 >= 0 and box.y1 <= figure.bbox.height for box in boxes)
        apart = [not a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k]]
        assert all(apart)


def test_singular_values_state_the_number_of_styles(model: pdmp.Model) -> None:
    """The title has J and the number of singular values."""
    (axes,) = plot.singular_values(model).axes
    assert axes.get_title().startswith("J = 2 of 5: ")


@pytest.mark.parametrize("n_demos", [1, 5])
def test_the_legend_of_singular_values_is_beside_the_bars(n_demos: int) -> None:
    """A single bar leaves no room for a legend in its panel."""
    figure = plot.singular_values(pdmp.fit(reaches()[:n_demos]))
    figure.canvas.draw()
    (legend,) = figure.legends
    assert not legend.get_window_extent().overlaps(figure.axes[0].get_window_extent())


def test_styles_are_labelled(model: pdmp.Model) -> None:
    """Each label has a point per demonstration."""
    axes = plot.styles(model, ["a", "a", "b", "b", "b"]).axes[0]
    assert [len(dots.get_offsets()) for dots in axes.collections] == [2, 3]


def test_styles_show_the_context(model: pdmp.Model) -> None:
    """Without labels, a context of one number colours the points."""
    assert "context" in labels_of(plot.styles(model))
    heights = [0.1, 0.2, 0.3, 0.5, 0.4]
    named = pdmp.fit(reaches(), contexts={"height": heights})
    assert "height" in labels_of(plot.styles(named))


def test_a_single_demonstration_has_its_index_and_context() -> None:
    """Neither demonstrations below 0 nor contexts around the only one are on an axis."""
    figure = plot.styles(pdmp.fit(reaches()[:1], contexts={"height": [0.25]}))
    figure.canvas.draw()
    styles, bar = figure.axes
    assert styles.get_ylim() == (-0.5, 0.5)
    assert [tick for tick in styles.get_yticks() if abs(tick) <= 0.5] == [0]
    assert [text.get_text() for text in bar.get_yticklabels()] == ["0.25"]


def test_styles_that_vary_little_have_legible_ticks() -> None:
    """Labels with many digits do not overlap."""
    demos = [demo.position + 0.0 for demo in reaches()]
    mean = np.mean([np.resize(demo, demos[0].shape) for demo in demos], axis=0)
    almost_equal = [mean + 3e-3 * (np.resize(demo, mean.shape) - mean) for demo in demos]
    figure = plot.styles(pdmp.fit(almost_equal, dt=0.01, n_styles=2))
    figure.canvas.draw()
    (axes,) = figure.axes
    boxes = [text.get_window_extent() for text in axes.get_xticklabels() if text.get_text()]
    assert max(len(text.get_text()) for text in axes.get_xticklabels()) >= 6
    assert all(a.x1 < b.x0 for a, b in zip(boxes, boxes[1:], strict=False))


@pytest.mark.parametrize("n_styles", [1, 2, 4])
def test_styles_of_any_dimension_can_be_drawn(n_styles: int) -> None:
    """One dimension is drawn against the demonstrations, three or more in two planes."""
    figure = plot.styles(pdmp.fit(reaches(), n_styles=n_styles), ["a"] * 5)
    assert len(figure.axes) == (2 if n_styles > 2 else 1)


def test_fan_has_a_movement_per_share(model: pdmp.Model) -> None:
    """A fan has n movements, and a colour bar that names the two ends."""
    ends = [model.conditions(m) for m in (0, 4)]
    figure = plot.fan(model, *ends, n=6, ends=("left", "right"))
    assert len(figure.axes[0].lines) == 6
    ticks = [text.get_text() for text in figure.axes[-1].get_yticklabels()]
    assert ticks == ["left", "half way", "right"]


def test_labels_of_equal_axes_are_inside_the_figure() -> None:
    """The limits of a path, and so the width of its tick labels, are known once it is drawn."""
    rng, t = np.random.default_rng(3), np.linspace(0, 1.5, 180)
    demos = []
    for height in (0.1, 0.15, 0.2, 0.3, 0.35):
        x = 0.5 * np.sin(np.pi * t / 3) + 0.002 * rng.normal(size=180)
        z = height * np.sin(np.pi * t / 1.5) ** 2 + 0.002 * rng.normal(size=180)
        demos.append(pdmp.Demonstration(np.column_stack([x, z]), time=t, units=["m", "m"]))
    model = pdmp.fit(demos)
    figure = plot.fan(model, model.conditions(0), model.conditions(4))
    figure.savefig(BytesIO())
    for axes in figure.axes:
        assert axes.yaxis.label.get_window_extent().x0 >= 0


def test_fan_needs_two_ends(model: pdmp.Model) -> None:
    """A fan of fewer than two movements is rejected."""
    style = model.conditions(0)
    with pytest.raises(ValueError, match="n = 1"):
        plot.fan(model, style, style, n=1)


def test_phase_portrait_has_cycles_and_a_movement_from_rest(rhythmic: pdmp.Model) -> None:
    """Each panel has the cycle of every demonstration and one movement from rest."""
    figure = plot.phase_portrait(rhythmic)
    assert [len(axes.lines) for axes in figure.axes] == [rhythmic.n_demos + 1] * rhythmic.n_dofs
    assert "velocity [m/s]" in labels_of(figure)


def test_phase_portrait_needs_a_rhythmic_model(model: pdmp.Model) -> None:
    """A discrete primitive has no limit cycle."""
    with pytest.raises(ValueError, match="discrete primitive has no limit cycle"):
        plot.phase_portrait(model)


def test_prediction_error_is_drawn_over_the_styles(evaluation: Evaluation) -> None:
    """Each reach has a panel: mean and deviation per J, and the mean demonstration's level."""
    figure = plot.prediction_error(evaluation, unit="m")
    assert [axes.get_title() for axes in figure.axes] == ["interpolation", "extrapolation"]
    label = "mean squared error E [m²]"
    assert labels_of(figure) == {"number of style parameters J", label, ""}
    # The unit is that of the demonstrations.
    assert labels_of(plot.prediction_error(evaluation)) == labels_of(figure)
    for axes in figure.axes:
        (curve,) = axes.containers
        assert curve.lines[0].get_xdata().tolist() == [1, 2]


def test_small_prediction_errors_are_legible_beside_large_ones() -> None:
    """Errors that differ by orders of magnitude are drawn on a logarithmic axis."""
    heights = [0.1, 0.2, 0.3, 0.4, 0.5]
    t = np.linspace(0, 1, 100)
    demos = [np.column_stack([t**2 * (3 - 2 * t), h * np.sin(np.pi * t) ** 2]) for h in heights]
    curve = pdmp.evaluate(demos, contexts=heights, dt=0.01, predictors=over_styles(2))
    figure = plot.prediction_error(curve)
    smallest = min(curve.summary(name).error for name in curve.scores)
    for axes in figure.axes:
        assert axes.get_yscale() == "log"
        assert 0 < axes.get_ylim()[0] < smallest


def test_prediction_error_needs_numbers_of_styles() -> None:
    """Predictors without J are rejected."""
    with pytest.raises(ValueError, match="no PDMP with n_styles among mean demonstration"):
        plot.prediction_error(pdmp.evaluate(reaches(), predictors={}))


def test_held_out_movements_have_a_column_per_reach(evaluation: Evaluation) -> None:
    """Each degree of freedom has a panel with recording, forecast and band."""
    figure = plot.held_out(evaluation, "PDMP, J = 2", unit="m")
    titles = [axes.get_title() for axes in figure.axes[:2]]
    assert titles[0].startswith("interpolation, context ")
    assert len(figure.axes) == 4
    for axes in figure.axes:
        assert (len(axes.lines), len(axes.collections)) == (2, 1)
        # An exact prediction does not cover the recording.
        recording, predicted = axes.lines
        assert recording.get_linewidth() > 2 * predicted.get_linewidth()


def test_given_axes_are_drawn_into(model: pdmp.Model) -> None:
    """Given panels are drawn into row by row, and their figure is returned."""
    figure = Figure()
    axes = figure.subplots()
    assert plot.singular_values(model, ax=axes) is figure
    assert axes.lines
    assert figure.axes == [axes]
    grid = Figure().subplots(3, 2)
    plot.demonstrations(model, reaches(), labels=["b", "b", "a", "a", "a"], ax=grid)
    assert [each.get_title() for each in grid[0]] == ["b", "a"]
    assert [len(each.lines) for each in grid[:, 1]] == [6, 6, 6]
    assert not grid[0, 0].figure.legends
    assert grid[0, 0].get_legend() is not None


def test_panels_are_made_in_the_place_of_one_axes(
    model: pdmp.Model, rhythmic: pdmp.Model, evaluation: Evaluation
) -> None:
    """Each figure of several panels fits into one Axes, also that of a part of a figure."""
    part = Figure(layout="constrained").subfigures(1, 2)[0]
    for draw in (
        lambda ax: plot.demonstrations(model, reaches(), ax=ax),
        lambda ax: plot.fan(model, model.conditions(0), model.conditions(4), ax=ax),
        lambda ax: plot.motion(model.rollout(), ax=ax),
        lambda ax: plot.cut_off(reaches()[0], ax=ax),
        lambda ax: plot.variation(reaches(), ax=ax),
        lambda ax: plot.phase_portrait(rhythmic, ax=ax),
        lambda ax: plot.prediction_error(evaluation, ax=ax),
        lambda ax: plot.held_out(evaluation, "PDMP, J = 2", ax=ax),
        lambda ax: plot.styles(model, ax=ax),
    ):
        part.clear()
        left, right = part.subplots(1, 2)
        figure = draw(right)
        figure.canvas.draw()
        assert figure is part.figure
        assert not left.has_data()
        boxes = [axes.get_position() for axes in part.axes if axes.has_data()]
        assert boxes
        assert all(box.x0 > left.get_position().x1 for box in boxes)


def test_axes_of_another_number_are_rejected(model: pdmp.Model) -> None:
    """The error has the rows and columns that are expected."""
    with pytest.raises(ValueError, match="ax has 4 panels, expected 6: 2 rows of 3; or pass one"):
        plot.motion(model.rollout(), ax=Figure().subplots(2, 2))
    with pytest.raises(ValueError, match=r"not one of pyplot.subplots: pass 2 Axes, 1 rows of 2"):
        plot.variation(reaches(), ax=Figure().add_axes((0, 0, 1, 1)))
    wrong: Any = Figure()
    with pytest.raises(TypeError, match="ax: expected Axes of matplotlib, got Figure"):
        plot.styles(model, ax=wrong)


def test_sizes_and_colours_follow_matplotlib(model: pdmp.Model) -> None:
    """Changed rcParams set size, resolution, colours and colour map."""
    usual = plot.singular_values(model)
    with rc_context(
        {
            "figure.figsize": (3.2, 2.4),
            "figure.dpi": 50,
            "axes.prop_cycle": cycler(color=["red", "lime"]),
            "image.cmap": "magma",
        }
    ):
        changed = plot.singular_values(model)
        (axes,) = changed.axes
        styles = plot.styles(model).axes[0]
    assert usual.dpi == 150
    assert changed.dpi == 50
    assert changed.get_size_inches().tolist() == (usual.get_size_inches() / 2).tolist()
    assert axes.patches[0].get_facecolor() == (1, 0, 0, 1)
    assert axes.lines[0].get_color() == "lime"
    assert styles.collections[0].get_cmap().name == "magma"


def test_saved_figure_is_a_png(model: pdmp.Model, tmp_path: Path) -> None:
    """Saving writes a PNG only."""
    plot.save(plot.singular_values(model), tmp_path / "singular_values.png")
    (file,) = tmp_path.iterdir()
    assert file.read_bytes().startswith(b"\x89PNG")


def test_missing_folders_are_not_created(model: pdmp.Model, tmp_path: Path) -> None:
    """Figures, trajectories and models are written into existing folders only."""
    path = tmp_path / "new" / "file"
    writers: list[Callable[[], object]] = [
        lambda: plot.save(plot.singular_values(model), path),
        lambda: pdmp.io.write_csv(path, model.rollout()),
        lambda: model.rollout().to_csv(path),
        lambda: model.save(path),
    ]
    for write in writers:
        with pytest.raises(FileNotFoundError, match="no such folder; create it first") as error:
            write()
        assert error.value.filename == str(tmp_path / "new")
    assert not list(tmp_path.iterdir())


def test_suffix_selects_the_format(model: pdmp.Model, tmp_path: Path) -> None:
    """The suffix selects the format; unsupported ones are rejected."""
    figure = plot.singular_values(model)
    plot.save(figure, tmp_path / "singular_values.pdf")
    assert (tmp_path / "singular_values.pdf").read_bytes().startswith(b"%PDF")
    with pytest.raises(ValueError, match="docx"):
        plot.save(figure, tmp_path / "singular_values.docx")
    assert [path.name for path in tmp_path.iterdir()] == ["singular_values.pdf"]


def test_missing_matplotlib_is_named(model: pdmp.Model, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without matplotlib, the error names the extra."""
    monkeypatch.delitem(sys.modules, "pdmp.plot._figure", raising=False)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(ImportError, match=r"pip install 'pdmp\[plot\]'"):
        plot.singular_values(model)


def test_cut_off_is_where_the_residual_equals_the_noise() -> None:
    """The fitted line at 0 Hz gives the level of noise; the dot is where the residual equals it."""
    rng = np.random.default_rng(2)
    t = np.arange(2000) * 0.005
    noise = 0.01 * rng.standard_normal((2000, 2))
    position = np.column_stack([np.sin(2 * np.pi * t), np.cos(4 * np.pi * t)]) + noise
    demo = pdmp.Demonstration(position, dt=0.005, names=["hip", "knee"], units=["rad", "rad"])
    figure = plot.cut_off(demo)
    assert labels_of(figure) == {"cut-off [Hz]", "RMS [rad]"}
    for axes, name in zip(figure.axes, ["hip", "knee"], strict=True):
        dot = next(line for line in axes.lines if line.get_label() == "cut-off")
        ((frequency, level),) = dot.get_xydata()
        assert level == pytest.approx(0.01, rel=0.15)
        assert 2 < frequency < 20
        assert axes.get_title() == f"{name}: {frequency:.2g} Hz"
    smooth = pdmp.preprocessing.lowpass(demo, frequency).position - position + noise
    assert np.std(smooth) < 0.5 * np.std(noise)


def test_cut_off_needs_a_clock() -> None:
    """A recording without times is rejected."""
    with pytest.raises(ValueError, match="has no times"):
        plot.cut_off(pdmp.Demonstration(np.zeros((9, 1))))


def test_motion_has_a_column_per_derivative_and_limits(model: pdmp.Model) -> None:
    """Position, velocity and acceleration have their units, and limits are dashed lines."""
    limits = pdmp.Limits(position=([-1, -2], [3, 4]), velocity=[1.5, 2.5])
    movements = {"free": model.rollout(), "fastest": model.fastest(limits)}
    figure = plot.motion(movements, limits=limits)
    assert labels_of(figure) >= {"x [m]", "x [m/s]", "y [m/s²]", "time [s]"}
    dashed = [
        sorted(line.get_ydata()[0] for line in axes.lines if line.get_linestyle() == "--")
        for axes in figure.axes
    ]
    assert dashed == [[-1, 3], [-1.5, 1.5], [], [-2, 4], [-2.5, 2.5], []]
    (velocity,) = [line for line in figure.axes[4].lines if line.get_label() == "fastest"]
    np.testing.assert_array_equal(velocity.get_ydata(), movements["fastest"].velocity[:, 1])
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["free", "fastest"]
    assert not plot.motion(model.rollout()).legends


def test_motion_of_a_pose_has_fewer_velocities_than_coordinates() -> None:
    """A unit quaternion has four coordinates and three angular velocities."""
    turn = 0.5 * np.linspace(0, 1, 60)[:, None] ** 2
    position = np.hstack([np.cos(turn), np.sin(turn), 0 * turn, 0 * turn])
    demo = pdmp.Demonstration(position, dt=0.02, rotations={0: "wxyz"})
    figure = plot.motion(pdmp.fit([demo], n_styles=1).rollout())
    drawn = [bool(axes.lines) for axes in figure.axes]
    assert drawn == [True] * 9 + [True, False, False]


@pytest.mark.parametrize(
    ("trajectories", "limits", "message"),
    [
        ([], None, "trajectories is empty"),
        ("both", None, r"trajectories\[1\] has the degrees of freedom"),
        (
            "one",
            pdmp.Limits(velocity=[1.0, 2.0, 3.0]),
            "limits of 3 degrees of freedom, expected 2",
        ),
    ],
)
def test_motion_rejects_other_degrees_of_freedom(
    model: pdmp.Model, rhythmic: pdmp.Model, trajectories: Any, limits: Any, message: str
) -> None:
    """A trajectory in other units or of other joints is not drawn over the first one."""
    given = {"both": [model.rollout(), rhythmic.rollout()], "one": model.rollout()}
    with pytest.raises(ValueError, match=message):
        plot.motion(given.get(trajectories, []) if trajectories else [], limits=limits)


@pytest.mark.parametrize(
    ("trajectories", "message"),
    [
        (None, "trajectories = None: expected a Trajectory, as Model.rollout returns it"),
        (np.zeros((9, 2)), r"trajectories\[0\] = .*: expected a Trajectory"),
        ({"free": np.zeros((9, 2))}, r"trajectories\['free'\] = .*: expected a Trajectory"),
    ],
)
def test_motion_rejects_other_types(trajectories: Any, message: str) -> None:
    """A value that is no trajectory is named."""
    with pytest.raises(TypeError, match=message):
        plot.motion(trajectories)


def test_variation_is_mean_and_deviation_of_each_group() -> None:
    """The line is the mean of a group at each percent, and the band one standard deviation."""
    time = np.linspace(0, 1, 101)[:, None]
    demos = [pdmp.Demonstration(k * time, dt=0.01 * k, units=["m"]) for k in (1, 2, 3, 9)]
    figure = plot.variation(demos, ["a", "a", "a", "b"])
    (axes,) = figure.axes
    assert axes.get_xlabel() == "movement [%]"
    first, second = axes.lines
    np.testing.assert_allclose(first.get_ydata(), 2 * time[:, 0], atol=1e-12)
    np.testing.assert_allclose(second.get_ydata(), 9 * time[:, 0], atol=1e-12)
    # The deviation of 1, 2, 3 is 1, that of a single demonstration 0.
    heights = [np.ptp(band.get_paths()[0].vertices[:, 1]) for band in axes.collections]
    np.testing.assert_allclose(heights, [3, 9])
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["a (n = 3)", "b (n = 1)"]


def test_variation_of_cycles_ends_where_it_begins() -> None:
    """A cycle has no sample at its end, which is its beginning."""
    cycles = Cycles(loops(), [], [], [], np.zeros((0, 2)), [])  # type: ignore[arg-type]
    assert labels_of(plot.variation(cycles)) >= {"cycle [%]"}
    assert labels_of(plot.variation(cycles, kind="discrete")) >= {"movement [%]"}
    figure = plot.variation(loops(), kind="rhythmic")
    for axes in figure.axes:
        mean = axes.lines[-1].get_ydata()
        assert axes.get_xlabel() == "cycle [%]"
        assert mean[0] == pytest.approx(mean[-1], abs=1e-9)
        assert len(axes.lines) == len(loops()) + 1


@pytest.mark.parametrize(
    ("demos", "labels", "message"),
    [
        ([], None, "demos is empty"),
        (reaches(), ["a"], "labels has length 1, expected 5"),
        (
            [reaches()[0], pdmp.Demonstration(np.zeros((50, 3)), dt=0.1)],
            None,
            "demo 1 has 3 columns",
        ),
    ],
)
def test_variation_rejects_other_demonstrations(demos: Any, labels: Any, message: str) -> None:
    """Groups are of the same degrees of freedom, and every demonstration has one."""
    with pytest.raises(ValueError, match=message):
        plot.variation(demos, labels)


def test_figures_show_themselves_once(model: pdmp.Model) -> None:
    """A notebook shows the value of a cell by `_repr_png_`; pyplot does not show it again."""
    import matplotlib.pyplot as plt

    figure = plot.singular_values(model)
    assert figure._repr_png_().startswith(b"\x89PNG")
    assert not plt.get_fignums()
