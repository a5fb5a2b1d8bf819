"""Models and trajectories describe themselves in a line of text and in a table for notebooks."""

from html.parser import HTMLParser

import numpy as np
import pytest

import pdmp
from synthetic import loops

HOSTILE = "<script>alert('x')</script>\"&\x1b[31m\u202e"


class Table(HTMLParser):
    """The rows of the only table of a document; any other element is an error."""

    ELEMENTS = ("table", "caption", "thead", "tbody", "tr", "th", "td")

    def __init__(self, html: str) -> None:
        super().__init__()
        self.caption, self.rows, self._open = "", [], []
        self.feed(html)
        self.close()
        assert not self._open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Opens an element, which must be one of a table, without attributes."""
        assert tag in self.ELEMENTS and not attrs
        assert (tag == "table") == (not self._open)
        self._open.append(tag)
        if tag == "tr":
            self.rows.append([])
        elif tag in ("th", "td"):
            self.rows[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        """Closes the innermost element."""
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        """Adds text to the caption or to the last cell."""
        assert self._open[-1] in ("caption", "th", "td")
        if self._open[-1] == "caption":
            self.caption += data
        else:
            self.rows[-1][-1] += data


def hostile() -> pdmp.Model:
    """Returns a model whose names, units and labels are markup and control characters."""
    s = np.linspace(0, 1, 50)[:, None]
    position = s**2 * (3 - 2 * s) * [1.0, 2.0]
    demos = [
        pdmp.Demonstration(
            k * position,
            dt=0.02,
            context=[k, f"{HOSTILE}{k}"],
            names=["a" + HOSTILE, "b"],
            units=["m" + HOSTILE, "m"],
        )
        for k in (1.0, 2.0, 3.0)
    ]
    return pdmp.fit(demos, n_styles=1)


def test_model_is_a_table(reach: pdmp.Model) -> None:
    """The table has kind, degrees of freedom, time, styles, noise, contexts and map."""
    rows = dict(Table(reach._repr_html_()).rows)  # type: ignore[attr-defined]
    assert rows["kind"] == "discrete"
    assert rows["DoFs"] == "2: x [m], y [m]"
    assert rows["time"] == f"tau {reach.tau:.4f} s"
    assert rows["styles J"].startswith("2, ")
    assert rows["contexts"] == "[0] from -0.2 to 0.2"
    assert rows["context map"].startswith('"stacked" (')
    assert {"demonstrations", "measurement noise", "regression"} <= set(rows)


def test_period_of_a_rhythmic_model_is_in_seconds(cycle: pdmp.Model) -> None:
    """Both texts state the period; the time constant is the period over 2 pi."""
    text = f"period 2.0000 s (tau {2 / (2 * np.pi):.4f} s)"
    assert text in repr(cycle)
    assert dict(Table(cycle._repr_html_()).rows)["time"] == text  # type: ignore[attr-defined]
    assert "context" not in repr(cycle)


def test_context_map_and_landscape_are_not_mistaken(reach: pdmp.Model) -> None:
    """Each regression is named, and the error of the map is its own, not the least of all."""
    errors = dict(reach.map.errors)  # type: ignore[union-attr]
    text = repr(reach)
    assert "; regression NGnet, 50 functions" in text
    assert 'context map "stacked" (Gaussian process and line), mean squared' in text
    stated = float(text.split("leave-one-out error ")[1].split()[0])
    assert stated == pytest.approx(errors["stacked"], rel=0.05)
    assert f"(for comparison: gp {errors['gp']:.1e}".replace("e-0", "e-") in text


def test_labels_of_contexts_are_in_the_text() -> None:
    """Each context column is numbered, with its range or its labels."""
    demos = [loop.position for loop in loops()]
    contexts = [["slow", 1.0], ["fast", 2.5], ["slow", 2.0]]
    model = pdmp.fit(demos, kind="rhythmic", dt=0.02, contexts=contexts)
    assert "contexts [0] 'fast' or 'slow', [1] from 1 to 2.5;" in repr(model)


def test_trajectory_is_a_table_of_its_ends(reach: pdmp.Model) -> None:
    """Rows are the first and last three samples, columns the time and the positions."""
    trajectory = reach.rollout(dt=0.1)
    table = Table(trajectory._repr_html_())  # type: ignore[attr-defined]
    assert table.caption == "pdmp.Trajectory: 13 samples x 2 DoFs, 1.2000 s; positions"
    assert table.rows[0] == ["time [s]", "x [m]", "y [m]"]
    assert table.rows[4] == ["…"] * 3
    kept = [0, 1, 2, 10, 11, 12]
    expected = np.column_stack([trajectory.time, trajectory.position])[kept]
    found = np.array([table.rows[k] for k in (1, 2, 3, 5, 6, 7)], float)
    np.testing.assert_allclose(found, expected, atol=5e-5)


def test_short_trajectories_are_shown_in_whole(reach: pdmp.Model) -> None:
    """Up to six samples have one row each."""
    for n_samples in range(1, 7):
        trajectory = reach.rollout(dt=0.1, duration=0.1 * (n_samples - 1))
        assert len(Table(trajectory._repr_html_()).rows) == 1 + n_samples  # type: ignore[attr-defined]


def test_wide_models_and_trajectories_are_abridged() -> None:
    """Of forty degrees of freedom twelve are listed, with the number of the others."""
    s = np.linspace(0, 1, 40)[:, None]
    model = pdmp.fit([k * s**2 * np.ones(40) for k in (1.0, 2.0)], dt=0.02, n_styles=1)
    assert "y11, and 28 more)" in repr(model)
    rows = Table(model.rollout()._repr_html_()).rows  # type: ignore[attr-defined]
    assert {len(row) for row in rows} == {14}
    assert rows[0][-1] == "…"


def test_hostile_names_are_escaped() -> None:
    """Names, units and labels from files are text in a table, never markup or control codes."""
    model = hostile()
    for value in (model, model.rollout()):
        html = value._repr_html_()  # type: ignore[attr-defined]
        table = Table(html)
        assert "<script" not in html and "\x1b" not in html and "\u202e" not in html
        text = " ".join(" ".join(row) for row in table.rows)
        assert "<script>alert('x')</script>\"&\\u{1b}[31m\\u{202e}" in text
        assert repr(value).isascii() and repr(value).isprintable()
