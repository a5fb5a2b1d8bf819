"""The page of `Model.explorer` has the numbers of the library, in a browser and without one."""

import base64
import html
import json
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import pdmp
from browser import Browser, executable
from pdmp.cli.main import main
from pdmp.explorer._kinematics import evaluate, stick_figure
from synthetic import loops, reaches
from test_rotations import screw, times, turn

Array = NDArray[np.float64]
CLOSE = 1e-12
"""Largest deviation from the library, relative to the largest value."""


def data_of(page: str) -> dict[str, Any]:
    """Returns the data in a page."""
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert found
    data: dict[str, Any] = json.loads(found[1])
    return data


def decoded(packed: dict[str, Any]) -> Array:
    """Returns an array of a page."""
    numbers = np.frombuffer(base64.b64decode(packed["f64"]), "<f8")
    return numbers.reshape(packed["shape"])


def assert_close(found: Any, expected: Array) -> None:
    """Asserts equality relative to the largest value."""
    assert np.abs(np.asarray(found) - expected).max() <= CLOSE * np.abs(expected).max()


def poses(order: str, frame: str) -> pdmp.Model:
    """Returns a model of two rotations and three positions."""
    columns = [[0, 1, 2, 3], [1, 2, 3, 0]][order == "xyzw"]
    demos = []
    for style in (-0.4, -0.1, 0.2, 0.5):
        first, other = screw(style), screw(-style)
        position = np.column_stack([first[:, 3:][:, columns], first[:, :3], other[:, 3:]])
        rotations = {0: order, 7: "wxyz"}
        demos.append(pdmp.Demonstration(position, dt=0.01, rotations=rotations))
    return pdmp.fit(demos, n_styles=3).in_frame(frame)


def turning_cycles() -> pdmp.Model:
    """Returns a rhythmic model that turns fully in each cycle, and swings."""
    phi = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    demos = [
        pdmp.Demonstration(
            np.column_stack(
                [
                    np.cos(phi),
                    times(turn([0, 0, 1.0], phi), turn([1.0, 0, 0], swing * np.sin(phi))),
                ]
            ),
            dt=0.02,
            rotations={1: "wxyz"},
        )
        for swing in (0.2, 0.5, 0.8)
    ]
    return pdmp.fit(demos, kind="rhythmic", n_styles=2)


def warped() -> pdmp.Model:
    """Returns a model with several segments of time."""
    demos = [pdmp.Demonstration(demo.position, dt=0.02) for demo in reaches()]
    return pdmp.fit(demos, alignment="warp")


MODELS: dict[str, Callable[[], pdmp.Model]] = {
    "discrete": lambda: pdmp.fit(reaches(), n_styles=2),
    "immediate": lambda: pdmp.fit(reaches(), n_styles=2, transport="immediate"),
    "rhythmic": lambda: pdmp.fit(loops(), kind="rhythmic", n_styles=2),
    "one style": lambda: pdmp.fit(reaches(), n_styles=1),
    "own tau": lambda: pdmp.fit(reaches(), tau=0.5),
    "warped": warped,
    "poses": lambda: poses("wxyz", "body"),
    "poses in the world": lambda: poses("xyzw", "world"),
    "turning cycles": turning_cycles,
}

TURNING = {"poses", "poses in the world", "turning cycles"}
"""Models with rotations, whose positions are no sums of curves."""

# ---------------------------------------------------------------- without a browser


@pytest.mark.parametrize(
    "name", ["discrete", "immediate", "rhythmic", "one style", "own tau", "warped"]
)
def test_curves_in_the_page_add_up_to_rollouts(name: str) -> None:
    """For drawn conditions, sums of the curves equal position, velocity and acceleration."""
    model = MODELS[name]()
    data = data_of(model.explorer().html)
    styles, start = decoded(data["styles"]), decoded(data["start"])
    rng = np.random.default_rng(1)
    for _ in range(5):
        s = rng.normal(size=model.n_styles)
        g, y0 = rng.normal(size=(2, model.n_dofs))
        r, tau = (1.0, model.tau * rng.uniform(0.3, 3))
        conditions: dict[str, Any] = {"style": s, "goal": g, "start": y0}
        if model.kind == "rhythmic":
            r = rng.uniform(0.2, 2)
            conditions = {"style": s, "anchor": g, "amplitude": r}
        dt = data["extent"] * tau / data["steps"]
        made = model.rollout(**conditions, tau=tau, dt=dt)
        assert len(made.time) == data["steps"] + 1
        for k, expected in enumerate((made.position, made.velocity, made.acceleration)):
            found = r * np.tensordot(s, styles[k], axes=1) + (g if k == 0 else 0)
            if model.kind == "discrete":
                found = found + start[k][:, None] * (y0 - g)
            assert_close(found / tau**k, expected)


def test_mean_rotations_in_the_page_are_those_of_the_model() -> None:
    """Without style, and with start and goal on the mean, a movement is the mean rotation."""
    model = poses("wxyz", "body")
    data = data_of(model.explorer().html)
    means = decoded(data["means"])

    def at(k: int) -> Array:
        return np.concatenate([means[0, k, :4], [0.1, 0.2, 0.3], means[1, k, :4]])

    dt = data["extent"] * model.tau / data["steps"]
    style = np.zeros(model.n_styles)
    made = model.rollout(style=style, start=at(0), goal=at(data["centre"]), dt=dt)
    for r, (column, dof) in enumerate([(0, 0), (7, 6)]):
        rotation = made.position[:, column : column + 4]
        signs = np.sign(np.sum(rotation * means[r, :, :4], axis=1, keepdims=True))
        assert_close(means[r, :, :4] * signs, rotation)
        assert_close(means[r, :, 4:7] / model.tau, made.velocity[:, dof : dof + 3])
        assert_close(means[r, :, 7:] / model.tau**2, made.acceleration[:, dof : dof + 3])


def test_contexts_in_the_page_are_predictions() -> None:
    """Each row of the table is the prediction for its combination of numbers and labels."""
    contexts = [[i % 3, "ab"[i % 2]] for i in range(5)]
    model = pdmp.fit(reaches(), contexts=contexts)
    table = data_of(model.explorer().html)["contexts"]
    numbers, labels = (column["values"] for column in table["columns"])
    assert labels == ["a", "b"] and (numbers[0], numbers[-1]) == (0, 2)
    rows = decoded(table["table"]).reshape(len(numbers), 2, -1)
    for k, number in enumerate(numbers):
        for n, label in enumerate(labels):
            prediction = model.predict([number, label])
            one = prediction.conditions
            assert one.style is not None and one.goal is not None and one.start is not None
            expected = [*one.style, *one.goal, *one.start]
            assert rows[k, n, :-1].tolist() == expected
            share = prediction.duration / model.durations[model.nominal]
            assert np.isclose(rows[k, n, -1], model.tau * share, rtol=1e-14)


def test_contexts_with_too_many_combinations_are_omitted_with_a_note() -> None:
    """A page without sliders for the context says why."""
    rng = np.random.default_rng(0)
    model = pdmp.fit(reaches(), contexts=rng.normal(size=(5, 9)))
    data = data_of(model.explorer().html)
    assert data["contexts"] is None
    assert any("Contexts of 9 columns" in note for note in data["notes"])


def test_pages_of_warped_models_state_that_time_is_linear() -> None:
    """Segments of time are no conditions of the page, which says so."""
    model = warped()
    n_segments = model.segment_durations.shape[1]
    assert n_segments > 1
    [note] = data_of(model.explorer().html)["notes"]
    assert note.startswith(
        f"The model has {n_segments} time segments. This page shows movements in "
    )


def test_the_page_stands_alone() -> None:
    """The page names no address, and its policy forbids to load anything."""
    page = pdmp.fit(reaches()).explorer().html
    assert not re.search(r"https?://|//[\w.]+\.\w+/|@import|\bsrc=|<link\b", page)
    assert "default-src 'none'" in page
    assert page.count("<script") == 2 and page.count("<style") == 1


def test_names_cannot_end_the_data() -> None:
    """Tags in titles, names and labels remain text."""
    evil = '</script><script>alert("1")</script>'
    demos = [
        pdmp.Demonstration(demo.position, dt=0.02, names=[evil, "y"], context=[f"{evil}{k % 2}"])
        for k, demo in enumerate(reaches())
    ]
    page = pdmp.fit(demos).explorer(title=evil).html
    assert page.count("<script") == 2
    assert data_of(page)["coordinates"]["names"][0] == evil


def test_large_models_fit_into_two_megabytes_or_are_refused() -> None:
    """Sixty degrees of freedom and 300 recordings fit; what does not fit is an error."""
    rng = np.random.default_rng(0)
    s = np.linspace(0, 1, 60)[:, None]

    def library(n_demos: int, n_dofs: int) -> list[pdmp.Demonstration]:
        parts = rng.normal(size=(2, n_demos, n_dofs))
        bump, rise = np.sin(np.pi * s) ** 2, s**2 * (3 - 2 * s)
        paths = (goal * rise + bend * bump for goal, bend in zip(*parts, strict=True))
        return [pdmp.Demonstration(path, dt=0.02) for path in paths]

    demos = library(300, 60)
    model = pdmp.fit(demos, n_styles=12, smoothing=None)
    page = model.explorer(demonstrations=demos).html
    assert len(page.encode()) <= 2e6
    assert any("of 300 demonstrations" in note for note in data_of(page)["notes"])
    model = pdmp.fit(library(30, 150), n_styles=25, smoothing=None)
    with pytest.raises(ValueError, match=r"the page has \d+\.\d MB, more than 2 MB: fit fewer"):
        model.explorer()


def arm(q: Array) -> Array:
    """Returns the points of an arm: two hinges in degrees, a slide, and a hinge across."""
    a, b = np.deg2rad(q[0]), np.deg2rad(q[0] + q[1])
    elbow = np.array([np.cos(a), np.sin(a), 0])
    along = np.array([np.cos(b), np.sin(b), 0])
    wrist = elbow + (0.5 + q[2]) * along
    tip = wrist + 0.2 * (np.cos(q[3]) * along + np.sin(q[3]) * np.array([0, 0, 1]))
    return np.array([[0, 0, 0], elbow, wrist, tip])


@pytest.fixture(scope="module")
def arm_model() -> pdmp.Model:
    """Returns a model of the movements of an arm with four joints."""
    s = np.linspace(0, 1, 101)
    f = s**3 * (10 - 15 * s + 6 * s**2)
    demos = [
        pdmp.Demonstration(
            np.column_stack([90 * f, 40 * f + 60 * k * np.sin(np.pi * s) ** 2, 0.3 * f, k * f]),
            dt=0.01,
            names=["shoulder", "elbow", "slide", "wrist"],
            units=["deg", "deg", "m", "rad"],
        )
        for k in (-0.5, 0.1, 0.6)
    ]
    return pdmp.fit(demos)


def test_points_of_a_chain_are_exact_everywhere(arm_model: pdmp.Model) -> None:
    """Points of hinges and slides are exact far from the demonstrations too."""
    figure = stick_figure(arm_model, arm, None)
    assert [point["dofs"] for point in figure["points"]] == [[], [0], [0, 1, 2], [0, 1, 2, 3]]
    assert figure["links"] == [[0, 1], [1, 2], [2, 3]]
    rng = np.random.default_rng(0)
    for q in rng.normal(size=(20, 4)) * [180, 180, 1, 3]:
        found = [evaluate(point, q) for point in figure["points"]]
        assert np.abs(found - arm(q)).max() < 1e-12


def test_units_of_joints_are_found_where_they_are_unknown() -> None:
    """Without units, what acts evenly is a slide, and what does not is a hinge in rad."""
    rng = np.random.default_rng(2)
    s = np.linspace(0, 1, 50)[:, None]
    demos = [pdmp.Demonstration(rng.normal(size=2) * s**2 * (3 - 2 * s), dt=0.02) for _ in range(3)]
    figure = stick_figure(
        pdmp.fit(demos), lambda q: [[0, 0], [q[1] * np.cos(q[0]), q[1] * np.sin(q[0])]], [(0, 1)]
    )
    assert figure["points"][1]["turns"] == [2 * np.pi, None]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"limits": 3}, "limits = 3: expected pdmp.Limits"),
        ({"limits": pdmp.Limits(velocity=[1, 2, 3])}, "velocity has length 3, expected 2"),
        ({"dofs": ["q"]}, r"dofs has 'q': expected \['x', 'y'\] or their indices"),
        ({"dofs": "x"}, r"dofs = 'x': pass a list, \['x'\]"),
        ({"dofs": [2]}, "dofs has 2: expected an index from 0 to 1"),
        ({"title": 3}, "title = 3: expected a text"),
        ({"demonstrations": 3}, "demonstrations = 3: expected a list of demonstrations"),
        ({"demonstrations": []}, "0 recordings given, expected 5"),
        ({"links": [(0, 1)]}, "links apply to the points of kinematics: pass kinematics too"),
        ({"kinematics": 3}, "kinematics = 3: expected a function"),
        ({"kinematics": lambda q: q}, r"kinematics returns shape \[2\], expected \(P, 2\)"),
        (
            {"kinematics": lambda q: [[np.exp(q[0]), q[1]]]},
            r"kinematics: point 0 is no sum of products .* \(x \[m\], y \[m\]\): it differs by",
        ),
        ({"kinematics": lambda q: [q, 2 * q], "links": [(0, 2)]}, r"links has \[0, 2\]: expected"),
        ({"kinematics": lambda q: [q, 2 * q], "links": 3}, "links = 3: expected pairs"),
        ({"kinematics": lambda q: [q * np.nan]}, "kinematics returns a point that is not finite"),
    ],
    ids=lambda each: str(each)[:40],
)
def test_wrong_arguments_are_named(given: dict[str, Any], message: str, reach: pdmp.Model) -> None:
    """Each argument that does not fit is named, with the remedy."""
    with pytest.raises((ValueError, TypeError), match=message):
        reach.explorer(**given)


def gripper(order: str) -> Callable[[Array], Array]:
    """Returns the points of two bodies with the rotations of `poses`."""
    columns = [[0, 1, 2, 3], [3, 0, 1, 2]][order == "xyzw"]

    def points(q: Array) -> Array:
        tip = q[4:7] + rotated(q[columns], np.array([0.0, 0.02, 0.1]))
        return np.array([q[4:7], tip, q[4:7] + rotated(q[7:], np.array([0.1, 0.0, 0.0]))])

    return points


def rotated(q: Array, v: Array) -> Array:
    """Returns a vector, rotated by a unit quaternion w, x, y, z."""
    return times(times(q, np.concatenate([[0.0], v])), q * [1, -1, -1, -1])[1:]


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
def test_points_of_bodies_that_rotate_are_exact_everywhere(order: str) -> None:
    """Points of rotated bodies are exact for any rotation, in either order of components."""
    figure = stick_figure(poses(order, "body"), gripper(order), None)
    joints = [[4, 5, 6], [0, 4, 5, 6], [4, 5, 6, 7]]
    assert [point["dofs"] for point in figure["points"]] == joints
    rng = np.random.default_rng(0)
    for q in rng.normal(size=(20, 11)):
        for part in (q[:4], q[7:]):
            part /= np.linalg.norm(part)
        found = [evaluate(point, q) for point in figure["points"]]
        assert np.abs(found - gripper(order)(q)).max() < 1e-12


def test_points_of_many_joints_are_refused() -> None:
    """A point of more than eight joints has too large a table."""
    s = np.linspace(0, 1, 40)[:, None]
    demos = [pdmp.Demonstration(k * np.ones(9) * s**2 * (3 - 2 * s), dt=0.02) for k in (1, 2, 3)]
    with pytest.raises(ValueError, match="point 0 depends on 9 degrees of freedom, more than 8"):
        pdmp.fit(demos).explorer(kinematics=lambda q: [[np.sin(q).sum(), 0.0]])


def test_notebooks_frame_the_page(reach: pdmp.Model) -> None:
    """The frame in a notebook has the whole page, and no access to the notebook."""
    page = reach.explorer()
    found = re.fullmatch(r'<iframe srcdoc="([^"]*)"([^>]*)></iframe>', page._repr_html_())
    assert found and html.unescape(found[1]) == page.html
    assert "allow-scripts" in found[2] and "allow-same-origin" not in found[2]
    assert re.fullmatch(r"<pdmp.explorer.Explorer: page of \d+ kB>", repr(page))


def test_files_have_the_page(reach: pdmp.Model, tmp_path: Path) -> None:
    """The file has the page, in UTF-8; a missing folder is an error."""
    page = reach.explorer(tmp_path / "a.html")
    assert (tmp_path / "a.html").read_text(encoding="utf-8") == page.html
    with pytest.raises(FileNotFoundError, match="no such folder"):
        reach.explorer(tmp_path / "missing" / "a.html")


def test_the_command_writes_the_page(
    reach: pdmp.Model, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`pdmp explore` writes the page of `Model.explorer`."""
    reach.save(tmp_path / "reach.safetensors")
    out = str(tmp_path / "reach.html")
    arguments = ["--dofs", "y", "--title", "Reaches", "-o", out]
    assert main(["explore", str(tmp_path / "reach.safetensors"), *arguments]) == 0
    page = Path(out).read_text(encoding="utf-8")
    assert page == reach.explorer(dofs=["y"], title="Reaches").html
    assert re.fullmatch(r".*reach\.html: \d+ kB\n", capsys.readouterr().out)


def test_the_command_draws_recordings_and_limits_of_a_robot(
    reach: pdmp.Model, tmp_path: Path
) -> None:
    """Recordings and the joint limits of a URDF file are in the page."""
    links = "".join(f'<link name="{name}"/>' for name in "abc")
    joints = "".join(
        f'<joint name="{name}" type="prismatic"><parent link="{parent}"/><child link="{child}"/>'
        f'<limit lower="-1" upper="{upper}" velocity="2" effort="1"/></joint>'
        for name, parent, child, upper in [("x", "a", "b", 1.5), ("y", "b", "c", 0.5)]
    )
    (tmp_path / "robot.urdf").write_text(f'<robot name="r">{links}{joints}</robot>')
    reach.save(tmp_path / "reach.safetensors")
    folder = tmp_path / "recordings"
    folder.mkdir()
    for k, demo in enumerate(reaches()):
        rows = np.column_stack([0.02 * np.arange(demo.n_samples), demo.position])
        header = "t,x [m],y [m]"
        np.savetxt(folder / f"{k}.csv", rows, delimiter=",", header=header, comments="")
    out = tmp_path / "reach.html"
    files = [str(tmp_path / "reach.safetensors"), *sorted(map(str, folder.iterdir()))]
    assert main(["explore", *files, "--urdf", str(tmp_path / "robot.urdf"), "-o", str(out)]) == 0
    data = data_of(out.read_text(encoding="utf-8"))
    assert data["limits"]["upper"] == [1.5, 0.5] and data["limits"]["velocity"] == [2, 2]
    assert len(data["recordings"]) == 5
    drawn = np.frombuffer(base64.b64decode(data["recordings"][1]["position"]["f32"]), "<f4")
    np.testing.assert_array_equal(drawn.reshape(-1, 2)[-1], np.float32(reaches()[1].position[-1]))


# ---------------------------------------------------------------- in a browser


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Returns a browser, or skips the test without one."""
    program = executable()
    if program is None:
        pytest.skip("no Chromium: apt-get install chromium")
    with Browser(program) as started:
        started.resize(1280, 900)
        yield started


@pytest.fixture
def page(browser: Browser, tmp_path: Path) -> Iterator[Callable[..., Browser]]:
    """Returns a function that opens the page of a model; afterwards, nothing may have failed."""

    def opened(model: pdmp.Model, **options: Any) -> Browser:
        model.explorer(tmp_path / "page.html", **options)
        browser.open(tmp_path / "page.html")
        return browser

    browser.resize(1280, 900)
    browser.prefer()
    yield opened
    assert browser.problems() == []


MOVE = """
document.querySelectorAll("#controls .row input[type=range]").forEach((slider, i) => {
  const share = (1 + Math.sin(7.3 * i + ROUND)) / 2;
  slider.value = Number(slider.min) + share * (slider.max - slider.min);
  slider.dispatchEvent(new Event("input", { bubbles: true }));
});
"""
READ = """(() => {
  const { time, position, velocity, acceleration } = explorer.movement();
  const rows = (curves) => curves.map((curve) => Array.from(curve));
  return [[Array.from(time)], rows(position), rows(velocity), rows(acceleration)];
})()"""


def code(browser: Browser) -> str:
    """Returns the call that the page states, once it has been updated."""
    time.sleep(0.25)
    return str(browser.evaluate("document.getElementById('code').value"))


def assert_equals_rollout(browser: Browser, made: pdmp.Trajectory) -> None:
    """Asserts that the movement of the page is a rollout."""
    columns = (made.time[:, None], made.position, made.velocity, made.acceleration)
    for found, expected in zip(browser.evaluate(READ), columns, strict=True):
        assert_close(np.array(found).T, expected)


@pytest.mark.parametrize("name", MODELS)
def test_moved_sliders_give_the_movements_of_the_library(
    name: str, page: Callable[..., Browser]
) -> None:
    """After moves of all sliders, the page's movement is that of the call that it states."""
    model = MODELS[name]()
    opened = page(model)
    seen = set()
    for number in range(4):
        if number:
            opened.evaluate(MOVE.replace("ROUND", str(number)))
        call = code(opened)
        seen.add(call)
        assert_equals_rollout(opened, eval(call, {"model": model}))
    assert len(seen) == 4


def test_demonstrations_and_contexts_set_all_conditions(page: Callable[..., Browser]) -> None:
    """A selected demonstration is reproduced, and a context gives its prediction."""
    model = pdmp.fit(reaches())
    opened = page(model)
    opened.evaluate(
        "(() => { const menu = document.getElementById('demo');"
        "menu.value = 4; menu.dispatchEvent(new Event('change')); })()"
    )
    assert opened.evaluate("explorer.state.demo") == 4
    dt = model.durations[4] / 200
    assert_equals_rollout(opened, model.rollout(model.conditions(4), dt=dt))
    opened.evaluate("document.querySelector('#controls .row input[type=range]').focus()")
    opened.key("ArrowRight", 39)
    values = data_of(model.explorer().html)["contexts"]["columns"][0]["values"]
    [index] = opened.evaluate("explorer.state.context")
    prediction = model.predict([values[index]])
    assert index == len(values) // 2 + 1
    dt = prediction.duration / 200
    assert_equals_rollout(opened, model.rollout(prediction.conditions, dt=dt))
    # A change by hand is no longer that of the context.
    opened.evaluate(MOVE.replace("ROUND", "1"))
    assert opened.evaluate("[explorer.state.demo, ...explorer.state.context]") == [-1, -1]


def test_keys_and_clicks_select_styles(page: Callable[..., Browser], reach: pdmp.Model) -> None:
    """In the plane of styles a click takes a style, on a point its demonstration, a key a step."""
    opened = page(reach)

    def place(style: str) -> list[float]:
        found: list[float] = opened.evaluate(
            "(() => { const box = explorer.plane.canvas.getBoundingClientRect();"
            f"const [x, y] = explorer.plane.place({style});"
            "return [box.left + x, box.top + y]; })()"
        )
        return found

    def style() -> list[float]:
        found: list[float] = opened.evaluate("Array.from(explorer.state.conditions.style)")
        return found

    opened.click(*place(str(reach.styles[0].tolist())))
    assert style() == reach.styles[0].tolist()
    assert opened.evaluate("explorer.state.demo") == 0
    between = reach.styles[:2].mean(axis=0) + [0, 0.1 * np.ptp(reach.styles[:, 1])]
    opened.click(*place(str(between.tolist())))
    assert opened.evaluate("explorer.state.demo") == -1
    assert np.abs(style() - between).max() < 0.02 * np.ptp(reach.styles)
    before = style()
    opened.key("ArrowRight", 39)
    after = style()
    assert after[0] > before[0] and after[1] == before[1]
    opened.evaluate("document.querySelector('[aria-label=Style] input[type=range]').focus()")
    opened.key("ArrowLeft", 37)
    assert style()[0] < after[0] and style()[1] == after[1]
    assert_equals_rollout(opened, eval(code(opened), {"model": reach}))


def test_exact_numbers_can_be_typed(page: Callable[..., Browser], reach: pdmp.Model) -> None:
    """A number outside the range of a slider is taken; text that is no number is not."""
    opened = page(reach)
    field = "document.querySelector('#controls input[type=number]')"
    for text in ("7.25", "", "e"):
        opened.evaluate(
            f"{field}.focus(); {field}.value = '{text}'; {field}.dispatchEvent(new Event('input'))"
        )
        assert opened.evaluate("explorer.state.conditions.style[0]") == 7.25


def test_limits_are_compared_with_the_movement(page: Callable[..., Browser]) -> None:
    """The status names the limit that is exceeded most, and follows τ."""
    model = pdmp.fit(reaches())
    peak = abs(model.rollout(dt=0.002).velocity[:, 0]).max()
    opened = page(model, limits=pdmp.Limits(velocity=[1.1 * peak, 10.0]))
    assert "Within the limits." in opened.evaluate("document.getElementById('status').textContent")
    tau = "[...document.querySelectorAll('#controls .row')].at(-1).querySelector('[type=number]')"
    opened.evaluate(f"{tau}.value = {model.tau / 2}; {tau}.dispatchEvent(new Event('input'))")
    code(opened)
    status = opened.evaluate("document.getElementById('status').textContent")
    expected = f"velocity of x reaches {2 * peak:.4g} m/s, limit {1.1 * peak:.4g}"
    assert f"Duration {model.tau / 2:g} s. Beyond a limit: {expected}" in status


def test_saved_movements_are_read_back(page: Callable[..., Browser], tmp_path: Path) -> None:
    """The CSV of the page is that of the library."""
    model = pdmp.fit(reaches())
    text = page(model).evaluate("explorer.csv()")
    (tmp_path / "movement.csv").write_text(text, encoding="utf-8")
    made = model.rollout(model.conditions(model.nominal), dt=model.tau / 200)
    made.to_csv(tmp_path / "expected.csv")
    header = (tmp_path / "expected.csv").read_text(encoding="utf-8").splitlines()[0]
    assert text.splitlines()[0] == header
    found = pdmp.io.read_csv(tmp_path / "movement.csv", columns=["x", "y"])
    assert_close(found.position, made.position)


def test_the_stick_figure_follows_the_movement(
    page: Callable[..., Browser], arm_model: pdmp.Model
) -> None:
    """Points on the screen are those of the kinematics at the position."""
    opened = page(arm_model, kinematics=arm)
    for k in (0, 70, 200):
        points, position = opened.evaluate(
            f"[explorer.followers[0].pose(explorer.movement(), {k} / 200),"
            f" explorer.movement().position.map((curve) => curve[{k}])]"
        )
        assert_close(points, arm(np.array(position)))


def test_the_stick_figure_follows_a_pose(page: Callable[..., Browser]) -> None:
    """Points of a rotated body on the screen are those of the kinematics."""
    opened = page(poses("xyzw", "body"), kinematics=gripper("xyzw"))
    points, position = opened.evaluate(
        "[explorer.followers[0].pose(explorer.movement(), 0.35),"
        " explorer.movement().position.map((curve) => curve[70])]"
    )
    assert_close(points, gripper("xyzw")(np.array(position)))


def test_playback_draws_sixty_frames_a_second(
    page: Callable[..., Browser], arm_model: pdmp.Model
) -> None:
    """While it plays and all sliders move, the page computes a frame in half of 1/60 s."""
    opened = page(arm_model, kinematics=arm, limits=pdmp.Limits(velocity=100.0))
    opened.evaluate("document.getElementById('play').click(); explorer.frames.length = 0")
    shares = set()
    for number in range(40):
        opened.evaluate(MOVE.replace("ROUND", str(number / 9)))
        opened.settle()
        shares.add(opened.evaluate("explorer.state.share"))
    times_taken = opened.evaluate("explorer.frames.map(({ work }) => work)")
    assert len(times_taken) >= 40 and len(shares) > 20
    assert np.median(times_taken) < 1000 / 60
    opened.evaluate("document.getElementById('play').click()")
    assert opened.evaluate("explorer.state.playing") is False


def test_playback_rests_at_the_end_for_readers_who_prefer_less_motion(
    page: Callable[..., Browser], reach: pdmp.Model
) -> None:
    """Nothing plays on its own; with reduced motion playback does not repeat."""
    opened = page(reach)
    assert opened.evaluate("explorer.state.playing") is False
    opened.prefer(prefers_reduced_motion="reduce")
    opened.evaluate("explorer.state.speed = 50; document.getElementById('play').click()")
    end = time.monotonic() + 20
    while opened.evaluate("explorer.state.playing") and time.monotonic() < end:
        time.sleep(0.05)
    assert opened.evaluate("[explorer.state.playing, explorer.state.share]") == [False, 1]


def test_every_control_has_a_name_and_visible_focus(page: Callable[..., Browser]) -> None:
    """Screen readers find a name for every control and diagram; the keyboard reaches each."""
    contexts = [[k, "ab"[k % 2]] for k in range(5)]
    opened = page(pdmp.fit(reaches(), contexts=contexts), limits=pdmp.Limits(velocity=3.0))
    opened.evaluate("document.querySelectorAll('details').forEach((each) => (each.open = true))")
    code(opened)
    nodes = opened.call("Accessibility.getFullAXTree")["nodes"]
    roles = {"slider", "spinbutton", "combobox", "button", "checkbox", "textbox", "application"}
    named: dict[str, list[str]] = {}
    for node in nodes:
        role = node.get("role", {}).get("value", "").lower()
        if role in {*roles, "image", "img"}:
            named.setdefault(role, []).append(node.get("name", {}).get("value", ""))
    assert roles <= set(named), named
    assert all(name.strip() for names in named.values() for name in names), named
    assert len(named["slider"]) >= 9
    outlines = set()
    for _ in range(12):
        opened.key("Tab", 9)
        outlines.add(
            opened.evaluate(
                "(() => { const { outlineStyle, outlineWidth } = "
                "getComputedStyle(document.activeElement);"
                "return outlineStyle + outlineWidth; })()"
            )
        )
    assert outlines == {"solid3px"}


def luminance(colour: str) -> float:
    """Returns the relative luminance of a colour `#rrggbb`, as in WCAG 2."""
    parts = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_colours_are_readable(scheme: str, page: Callable[..., Browser], reach: pdmp.Model) -> None:
    """Texts have a contrast of at least 4.5, curves of 3, in both schemes."""
    opened = page(reach)
    opened.prefer(prefers_color_scheme=scheme)
    names = ["back", "card", "text", "faint", "movement", "limit", "mark", "focus"]
    colours = {
        name: luminance(
            opened.evaluate(
                f"getComputedStyle(document.documentElement).getPropertyValue('--{name}').trim()"
            )
        )
        for name in names
    }
    assert (colours["back"] > 0.5) == (scheme == "light")
    for name in names[2:]:
        for ground in ("back", "card"):
            low, high = sorted([colours[name], colours[ground]])
            least = 4.5 if name in ("text", "faint", "limit") else 3
            assert (high + 0.05) / (low + 0.05) >= least, (name, ground)


@pytest.mark.parametrize("width", [320, 600, 720, 1000, 1920])
def test_no_width_needs_horizontal_scrolling(
    width: int, page: Callable[..., Browser], arm_model: pdmp.Model
) -> None:
    """From telephones to wide screens, the page is as wide as the window, with drawn diagrams."""
    opened = page(arm_model, kinematics=arm)
    opened.resize(width, 800)
    opened.settle()
    assert opened.evaluate("document.documentElement.scrollWidth") == width
    widths = opened.evaluate("[...document.querySelectorAll('canvas')].map((c) => c.clientWidth)")
    assert len(widths) == 11 and min(widths) >= 180
