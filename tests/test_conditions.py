"""Arguments of a movement: those of demonstrations, and those in between."""

from typing import Any

import numpy as np
import pytest

import pdmp
from synthetic import loops, reaches


@pytest.mark.parametrize("m", range(5))
def test_rollout_as_demonstrated_gives_the_demonstration_back(m: int) -> None:
    """With all styles, style, place and pace of a demonstration repeat it."""
    demos = reaches()
    model = pdmp.fit(demos, n_styles=5)
    made = model.rollout(**pdmp.as_demonstrated(model, m), dt=0.02)
    np.testing.assert_allclose(made.position, demos[m].position, atol=1e-3)


def test_rhythmic_movement_as_demonstrated_gives_the_cycle_back() -> None:
    """A rhythmic one repeats its demonstration, from the first tick on."""
    demos = loops()
    model = pdmp.fit(demos, kind="rhythmic", n_styles=2)
    made = model.rollout(**pdmp.as_demonstrated(model, 1), dt=0.02)
    np.testing.assert_allclose(made.position[:-1], demos[1].position, atol=1e-2)


def test_several_demonstrations_give_their_mean() -> None:
    """Style, place and duration are averaged."""
    model = pdmp.fit(reaches())
    mean = pdmp.as_demonstrated(model, [0, 1])
    np.testing.assert_allclose(mean["goal"], model.goals[:2].mean(axis=0))
    np.testing.assert_allclose(mean["style"], model.styles[:2].mean(axis=0))


def test_blend_ends_at_both() -> None:
    """A share of 0 is the first, 1 the second, a half the mean."""
    a, b = {"style": [0.0, 1.0], "tau": 1.0}, {"style": [2.0, 1.0], "tau": 3.0}
    for share, expected in ((0, [0, 1]), (1, [2, 1]), (0.5, [1, 1])):
        np.testing.assert_array_equal(pdmp.blend(a, b, share)["style"], expected)
    assert pdmp.blend(a, b, 0.5)["tau"] == 2.0


@pytest.mark.parametrize("demos", [1.0, None, "1", [[0, 1], [1, 0]]])
def test_index_is_a_whole_number(demos: Any) -> None:
    """What is no index, or list of them, is told as it was given."""
    with pytest.raises(ValueError, match="demos = .*: pass the index of a demonstration"):
        pdmp.as_demonstrated(pdmp.fit(reaches()), demos)


def test_blend_refuses_what_has_no_middle() -> None:
    """Labels, unequal lengths and a share that is no number are refused by name."""
    for a, b in (("left", "right"), ([1.0], [1.0, 2.0])):
        with pytest.raises(ValueError, match="style: .* cannot be blended"):
            pdmp.blend({"style": a}, {"style": b}, 0.5)
    with pytest.raises(ValueError, match="share = nan: must be finite"):
        pdmp.blend({"style": [1.0]}, {"style": [2.0]}, float("nan"))


def test_blend_refuses_a_name_that_one_lacks() -> None:
    """What has no counterpart is named."""
    with pytest.raises(ValueError, match="goal: given for one of the two only"):
        pdmp.blend({"style": [1.0]}, {"style": [1.0], "goal": [0.0]}, 0.5)


@pytest.mark.parametrize("demos", [-1, 5, [0, 7], []])
def test_unknown_demonstration_is_refused(demos: int | list[int]) -> None:
    """An index outside the demonstrations is refused with the range."""
    with pytest.raises(ValueError, match=r"between 0 and 4|empty"):
        pdmp.as_demonstrated(pdmp.fit(reaches()), demos)
