"""The paper's claims, on simulated movements and a simulated robot."""

import itertools
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pdmp
from reproduction import bounded, film, heights, one_dof, rivals, styles, walking
from reproduction import swing as arms
from reproduction.__main__ import main
from reproduction.baxter import mjcf
from reproduction.demo import main as demo_main
from reproduction.human import BOX, HAND_HEIGHT, minimum_jerk
from reproduction.loop import NewGoal, from_rest, reach_over
from reproduction.reaching import GOAL, Reaching, demonstrate, height_of
from reproduction.robot import Robot, boxes
from reproduction.run import reproduce
from reproduction.torques import DT

CLOSE = 1.0  # mm


@pytest.fixture(scope="module")
def reaching() -> Reaching:
    """Returns the fifteen reaches, or skips without MuJoCo and the robot model."""
    try:
        return demonstrate()
    except ImportError as reason:
        pytest.skip(str(reason))


@pytest.fixture(scope="module")
def learnt(reaching: Reaching) -> pdmp.Model:
    """Returns a model of all reaches with three styles."""
    return styles.learn(reaching)


def test_one_dof_has_three_dimensions_and_is_reproduced() -> None:
    """Twenty demonstrations of three dimensions have three styles (Fig. 2)."""
    noise = np.random.default_rng(3)
    for example in (one_dof.discrete(noise), one_dof.rhythmic(noise)):
        values = example.model.singular_values
        assert values[3] < 1e-12 * values[0]
        assert values[2] > 0.05 * values[0]
        assert max(example.error(m) for m in range(one_dof.N_DEMOS)) < 1e-5


def test_hands_move_with_minimum_jerk() -> None:
    """Through points of the straight minimum-jerk movement, the path is that movement."""
    share = np.linspace(0, 1, 101)
    straight = share**3 * (10 - 15 * share + 6 * share**2)
    end = np.array([0.3, -0.2, 0.1])
    points = straight[[0, 35, 65, 100], None] * end
    np.testing.assert_allclose(minimum_jerk(points)(share), straight[:, None] * end, atol=2e-5)


def test_arm_reaches_the_requested_positions(reaching: Reaching) -> None:
    """Inverse kinematics gives the requested hand position and swivel angle."""
    hands = np.linspace(reaching.task.start, reaching.task.goal + [0, 0, 0.2], 9)
    angles = np.linspace(-0.3, 0.1, 9)
    path = reaching.arm.reach(hands, angles, reaching.start)
    np.testing.assert_allclose(reaching.arm.hands(path), hands, atol=1e-6)
    np.testing.assert_allclose([reaching.arm.swivel(q) for q in path], angles, atol=1e-5)
    with pytest.raises(ValueError, match="out of reach"):
        reaching.arm.reach(hands[:1] + [2.0, 0, 0], angles[:1], reaching.start)


def test_people_clear_their_boxes(reaching: Reaching) -> None:
    """No demonstration touches its boxes on the robot."""
    for demo in reaching.demos:
        whole = pdmp.fit([demo], n_styles=1)
        robot = Robot(demo.position[0], reaching.task, boxes(height_of(demo)))
        made = whole.rollout(dt=DT)
        for state in zip(made.position, made.velocity, made.acceleration, strict=True):
            robot.move(*state)
        assert robot.log.contact() == 0
        assert robot.log.tracking_error() < 5e-3


def test_boxes_on_the_path_are_hit(reaching: Reaching, learnt: pdmp.Model) -> None:
    """A movement demonstrated without boxes touches two of them and topples the upper one."""
    robot = reach_over(learnt, reaching, 0.30, learnt.styles[0])
    assert robot.log.contact() > 0.01
    height = robot.data.body("box_1").xpos[2] - (reaching.task.goal[2] - HAND_HEIGHT)
    assert height < 1.5 * BOX[2] - 0.01


def test_singular_values_select_three_styles(reaching: Reaching) -> None:
    """For the training reaches, three styles exceed 90 % of the singular values, two do not."""
    values = heights.learn(reaching, 3).singular_values
    shares = values.cumsum() / values.sum()
    assert shares[1] < 0.9 < shares[2]


def test_error_saturates_at_three_styles(reaching: Reaching) -> None:
    """Beyond three styles, predictions change by 2 %; the third halves the best style's error.

    As found: E = 0.043 with one style, 0.057 with two, 0.052 from three on; at best 0.028 with two
    and 0.012 with three.
    """
    found = heights.errors(reaching, max_styles=6)
    predicted, best = found.predicted.mean(axis=1), found.best.mean(axis=1)
    np.testing.assert_allclose(predicted[3:], predicted[2], rtol=0.02)
    assert predicted[0] < predicted[2] < 0.95 * predicted[1] < 0.06
    assert (np.diff(best) < 0).all()
    assert best[2] < 0.6 * best[1] < 0.02


@pytest.mark.parametrize(("n_styles", "clear"), [(1, 0), (2, 1), (3, 3)])
def test_three_styles_are_needed_over_four_boxes(
    reaching: Reaching, n_styles: int, clear: int
) -> None:
    """With fewer than three styles, at most one movement over four boxes clears them."""
    model = styles.learn(reaching, n_styles)
    tallest = [m for m, demo in enumerate(reaching.demos) if boxes(height_of(demo)) == 4]
    robots = [reach_over(model, reaching, 0.60, model.styles[m], tau=model.tau) for m in tallest]
    assert sum(robot.log.contact() == 0 for robot in robots) == clear


def test_every_other_style_clears_its_boxes(reaching: Reaching, learnt: pdmp.Model) -> None:
    """With three styles, movements demonstrated over up to three boxes touch none of them."""
    for demo, style in list(zip(reaching.demos, learnt.styles, strict=True))[:12]:
        robot = reach_over(learnt, reaching, height_of(demo), style, tau=learnt.tau)
        assert robot.log.contact() == 0


@pytest.mark.parametrize(("n_styles", "height", "touches"), [(1, 0.15, True), (3, 0.15, False)])
def test_new_heights(reaching: Reaching, n_styles: int, height: float, touches: bool) -> None:
    """The movement predicted for one box clears it with three styles, and not with one."""
    robot = heights.reach_predicted(heights.learn(reaching, n_styles), reaching, height)
    assert (robot.log.contact() > 0) == touches
    assert reaching.miss(robot.log.hands[-1]) < CLOSE


def test_four_boxes_are_touched_briefly(reaching: Reaching) -> None:
    """The movement extrapolated to four boxes touches them for some hundredths of a second.

    The paper's movement clears them; ours meets the elbow's limit on the way. It still arrives.
    """
    robot = heights.reach_predicted(heights.learn(reaching, 3), reaching, 0.60)
    assert 0 < robot.log.contact() < 0.05
    assert np.min(robot.log.measured, axis=0)[3] == pytest.approx(reaching.arm.lowest[3], abs=0.01)
    assert np.min(robot.log.commanded, axis=0)[3] < reaching.arm.lowest[3] - 0.1
    assert reaching.miss(robot.log.hands[-1]) < CLOSE


def test_limits_keep_the_command_over_four_boxes(reaching: Reaching) -> None:
    """A controller with limits stops the elbow at its limit; the path beyond it is refused."""
    ends = reaching.arm.lowest, reaching.arm.highest
    np.testing.assert_allclose(bounded.ARM.position, ends, atol=5e-6)
    model = heights.learn(reaching, 2)
    style = heights.predicted_style(model, 0.60)
    free = heights.reach_predicted(model, reaching, 0.60)
    inside = bounded.reach_inside(model, reaching, 0.60, style)
    assert bounded.beyond(free) > 0.2
    assert bounded.beyond(inside) == 0
    assert inside.log.tracking_error() < 0.5 * free.log.tracking_error()
    assert reaching.miss(inside.log.hands[-1]) < CLOSE
    assert bounded.reach_fastest(model, reaching, 0.60, style) is None


def test_the_path_over_one_box_is_followed_as_fast_as_limits_allow(reaching: Reaching) -> None:
    """It is faster than with any constant time constant, and clears the box like before."""
    model = heights.learn(reaching, 3)
    reached = bounded.reach_fastest(model, reaching, 0.15, heights.predicted_style(model, 0.15))
    assert reached is not None
    robot, constant = reached
    assert len(robot.log.commanded) * DT < 0.9 * constant
    assert bounded.beyond(robot) == 0 and robot.log.contact() == 0
    assert robot.log.tracking_error() < 5e-3


def test_every_style_reaches_every_goal(reaching: Reaching, learnt: pdmp.Model) -> None:
    """The end depends on the goal alone, and the effect of a goal does not depend on the style."""
    near, *others = styles.goals(reaching)
    for goal in others:
        added = []
        for style in learnt.styles:
            there, here = (
                learnt.rollout(
                    style=style, goal=g, start=reaching.start, duration=8.0, dt=0.02
                ).position
                for g in (goal, near)
            )
            np.testing.assert_allclose(there[-1], goal, atol=1e-3)
            added.append(there - here)
        np.testing.assert_allclose(added, added[:1] * len(added), atol=1e-9)


def test_goal_moved_during_the_movement_is_reached(reaching: Reaching) -> None:
    """A goal moved during the movement is reached on the robot, at any height and as smoothly."""
    model = heights.learn(reaching, 3)
    command = heights.new_goal(model, reaching)
    assert reaching.miss(reaching.arm.positions(command.goal)[2]) > 100
    robot = heights.reach_predicted(model, reaching, 0.15, command)
    assert reaching.miss(robot.log.hands[-1], command.goal) < CLOSE
    assert robot.log.contact() == 0
    assert robot.log.tracking_error() < 5e-3


def test_other_methods_fail_as_the_paper_argues(reaching: Reaching) -> None:
    """A DMP reproduces one height, components ignore the goal, a library does not extrapolate."""
    command, lock = rivals.disturbances(reaching)
    tall = {
        name: rivals.run_trial(rival, reaching, 0.60, command, lock)
        for name, rival in rivals.RIVALS.items()
    }
    primitive, single, components, library = tall.values()
    for trial in (single, library):
        assert trial.alone.log.contact() > 1
    assert components.alone.log.contact() < 0.05
    left = [
        reaching.miss(trial.moved.log.hands[-1], command.goal) for trial in (primitive, components)
    ]
    assert left[0] < CLOSE < 100 < left[1]
    assert 2 * primitive.speed_ratio() < components.speed_ratio()
    assert primitive.locked.log.contact() == 0


def test_switches_converge_within_five_periods() -> None:
    """After switches of style, amplitude and frequency, the distance to the cycle is below 3 %."""
    names = list(arms.STYLES)
    model = walking.learn(arms.demonstrate())
    commands = walking.switches(
        model, [names.index(n) for n in ("normal", "running", "tired")], names
    )
    done = walking.swing(model, commands, interval=9.0)
    assert max(done.distances) < 0.03
    assert min(done.distances[1:]) > 0
    apart = [np.ptp(done.position[k : k + 1000], axis=0).max() for k in (7_000, 16_000, 43_000)]
    assert apart[1] > 1.5 * apart[0] > 1.5 * apart[2]


def test_both_arms_swing_on_the_robot(reaching: Reaching) -> None:
    """Tracking errors stay within 10 mrad while styles change."""
    names = list(arms.STYLES)
    model = walking.learn(arms.demonstrate())
    commands = walking.switches(
        model, [names.index(n) for n in ("normal", "marching", "girly")], names
    )
    robot = Robot(model.rollout(**commands[0].command).position[0])
    walking.swing(model, commands, robot, interval=2.0)
    assert robot.log.tracking_error() < 0.01


def test_images_show_the_robot_move(reaching: Reaching, learnt: pdmp.Model) -> None:
    """A strip has a frame per time, and the frames differ."""
    robot = reach_over(learnt, reaching, 0.30, learnt.styles[7])
    try:
        figure = film.strip({"two boxes": (robot, [0.0, 1.4, 4.0])}, film.REACHING)
    except film.RendererError as reason:
        pytest.skip(str(reason))
    frames = [axes.get_images()[0].get_array() for axes in figure.axes]
    assert len(frames) == 3
    for one, other in itertools.pairwise(frames):
        assert np.mean(one != other) > 0.01


def test_command_writes_tables_and_figures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The command writes the first figure, which needs no robot."""
    assert main(["fig2", "-o", str(tmp_path)]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"fig2.md", "fig2.png"}
    assert capsys.readouterr().out.strip() in (tmp_path / "fig2.md").read_text(encoding="utf-8")


def test_another_seed_is_another_person(tmp_path: Path) -> None:
    """Equal seeds give equal tables, different seeds different ones."""
    first, again, other = (reproduce("fig2", tmp_path, seed=seed) for seed in (1, 1, 2))
    assert first == again != other


def test_recordings_of_walks_are_learnt(tmp_path: Path) -> None:
    """Raw recordings of walks are learnt; those without arm swing are named."""
    noise = np.random.default_rng(5)
    header = "t," + ",".join(walking.RECORDED)
    for name in ("normal", "brisk", "striding", "girly"):
        style = arms.STYLES[name]
        path = np.vstack([arms.cycle(style, noise)] * 4)
        time = np.arange(len(path)) / (style.frequency * arms.N_SAMPLES)
        rows = np.column_stack([time, path])
        np.savetxt(tmp_path / f"{name}.csv", rows, "%.9g", ",", header=header, comments="")
    rows[:, 1:] = noise.normal(0, 1e-3, rows[:, 1:].shape)
    np.savetxt(tmp_path / "still.csv", rows, "%.9g", ",", header=header, comments="")
    reported, figure = walking.recorded(tmp_path)
    assert "4 walks, without still" in reported[0]
    assert len(figure.axes) == 16


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            {"figure": "fig6"},
            'figure = "fig6": must be one of fig2, fig3, fig4, fig5, comparison, all',
        ),
        ({"figure": "fig2", "seed": -1}, "seed = -1: must not be negative"),
        ({"figure": "fig5", "recordings": "nowhere"}, "recordings: nowhere is not a folder"),
        ({"figure": "fig3", "recordings": "."}, 'recordings: only "fig5" learns from them'),
    ],
)
def test_invalid_requests_are_reported(
    arguments: dict[str, Any], message: str, tmp_path: Path
) -> None:
    """Unknown figures, invalid seeds and missing recordings are named."""
    with pytest.raises(ValueError, match=message):
        reproduce(folder=tmp_path, **arguments)


def test_missing_robot_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """A missing robot model is reported with its installation."""
    monkeypatch.setattr("reproduction.baxter.find_spec", lambda name: None)
    with pytest.raises(ImportError, match="pip install --no-deps robosuite"):
        mjcf()


def test_printed_goal_is_a_hand_on_a_table(reaching: Reaching) -> None:
    """The printed goal is in front of the body, below the elbow, with a natural swivel angle."""
    shoulder, elbow, hand = reaching.arm.positions(GOAL)
    assert hand[0] > 0.3 and abs(hand[1]) < 0.1
    assert hand[2] < elbow[2] < shoulder[2]
    assert abs(np.degrees(reaching.arm.swivel(GOAL))) < 20
    assert (reaching.arm.lowest < GOAL).all() and (reaching.arm.highest > GOAL).all()


def test_commands_take_effect_once_at_any_time(reaching: Reaching, learnt: pdmp.Model) -> None:
    """Commands take effect once, also at times between two ticks."""
    for time in (0.0125, 0.4005, 1.0):
        command = NewGoal(time, GOAL + 0.1)
        movement = from_rest(learnt, reaching, learnt.styles[0])
        given = []
        for tick in range(1200):
            before = movement.goal.copy()
            command(tick * DT, movement, None)
            given.append(not np.array_equal(before, movement.goal))
        assert sum(given) == 1


def test_trials_beyond_reach_are_repeated() -> None:
    """With another seed, too, all fifteen reaches are within the joint limits."""
    pytest.importorskip("scipy")
    try:
        other = demonstrate(6)
    except ImportError as reason:
        pytest.skip(str(reason))
    assert len(other.demos) == 15
    for demo in other.demos:
        assert (demo.position > other.arm.lowest).all()
        assert (demo.position < other.arm.highest).all()


def test_demo_writes_model_report_and_figures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Every figure of the report exists, and the tables are printed."""
    assert demo_main(["-o", str(tmp_path)]) == 0
    report = (tmp_path / "report.md").read_text(encoding="utf-8")
    figures = re.findall(r"\((\w+\.png)\)", report)
    assert len(figures) == 5
    for name in [*figures, "model.safetensors"]:
        assert (tmp_path / name).stat().st_size > 0
    assert capsys.readouterr().out.strip() in report


@pytest.mark.parametrize(
    ("command", "module"), [(main, "reproduction"), (demo_main, "reproduction.demo")]
)
def test_commands_have_help_and_reject_a_dash(
    command: Any, module: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Help exits with 0 and has an example; "-" is rejected."""
    with pytest.raises(SystemExit, match="0"):
        command(["--help"])
    assert f"example: python -m {module}" in capsys.readouterr().out
    figure = ["fig2"] if command is main else []
    with pytest.raises(SystemExit, match="2"):
        command([*figure, "-o", "-"])
    assert "- is not a file" in capsys.readouterr().err


def test_commands_report_errors_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An invalid request exits with 1 and its reason."""
    assert main(["fig2", "--seed", "-1", "-o", str(tmp_path)]) == 1
    assert capsys.readouterr().err.strip() == "error: seed = -1: must not be negative"


def test_package_has_no_part_of_the_reproduction() -> None:
    """No module of the package names the reproduction, and only readers of limits its robot."""
    root = Path(pdmp.__file__).parent
    modules = list(root.rglob("*.py"))
    assert len(modules) > 30
    readers = {root / "_limits.py", *(root / "robots").glob("*.py")}
    named = re.compile("robosuite|reproduction[./]", re.IGNORECASE)
    assert not [path for path in modules if named.search(path.read_text(encoding="utf-8"))]
    named = re.compile("mujoco|baxter", re.IGNORECASE)
    others = [path for path in modules if path not in readers]
    assert not [path for path in others if named.search(path.read_text(encoding="utf-8"))]
