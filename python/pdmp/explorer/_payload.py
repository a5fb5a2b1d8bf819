"""Data of the page: curves, conditions and limits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pdmp._messages import check_type, counted, quoted, value_error
from pdmp._native import Conditions, Demonstration, Limits, Model
from pdmp.explorer._contexts import context_table
from pdmp.explorer._kinematics import stick_figure
from pdmp.explorer._packing import packed
from pdmp.plot.movements import check_demonstrations, sample_times

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

MAX_STEPS = 200
"""Steps of the curves: with straight lines between them, no corner is visible on a screen."""
MIN_STEPS = 40
MAX_CURVE_BYTES = 900_000
"""Size of the curves, of which 33 % more are in the page."""
MAX_DEMOS = 400
"""Demonstrations in the page; of more, every n-th."""
MAX_DEMO_BYTES = 100_000
MAX_RECORDED = 60
"""Recordings in the page: more are a grey area."""
MAX_RECORDED_SAMPLES = 100
MIN_RECORDED_SAMPLES = 20
MAX_RECORDED_BYTES = 150_000
MAX_PANELS = 12
LENGTHS = frozenset({"m", "cm", "mm", "km"})


def payload(
    model: Model,
    *,
    demonstrations: Sequence[Demonstration] | Mapping[str, Demonstration] | None,
    limits: Limits | None,
    kinematics: Callable[[NDArray[np.float64]], ArrayLike] | None,
    links: Sequence[tuple[int, int]] | None,
    dofs: Sequence[str | int] | None,
) -> dict[str, Any]:
    """Returns the data of the page, of types that JSON has; arrays are in base64."""
    panels = _panels(model, dofs)
    per_demo = 8 * (model.n_styles + 2 * model.n_coordinates + 1)
    chosen = _chosen(model.n_demos, min(MAX_DEMOS, MAX_DEMO_BYTES // per_demo + 2))
    per_step = 3 * 8 * model.n_styles * model.n_dofs
    steps = int(np.clip(MAX_CURVE_BYTES // per_step, MIN_STEPS, MAX_STEPS))
    styles, start, means, centre = model._unit_curves(steps)
    notes = [_time_note(model)] if model.segment_durations.shape[1] > 1 else []
    contexts, note = context_table(model, tau_of)
    notes += [note] if note else []
    if len(chosen) < model.n_demos:
        notes.append(f"{len(chosen)} of {model.n_demos} demonstrations are in this page.")
    data = {
        "kind": model.kind,
        "about": _about(model, demonstrations is not None),
        "n_styles": model.n_styles,
        "steps": steps,
        "extent": model.durations[model.nominal] / model.tau,
        "coordinates": {"names": model.coordinate_names, "units": model.coordinate_units},
        "dofs": {"names": model.names, "units": model.units},
        **_layout(model),
        "styles": packed(styles),
        "start": packed(start),
        "means": packed(means),
        "centre": centre,
        "demos": _demos(model, chosen),
        "recordings": None if demonstrations is None else _recordings(model, demonstrations),
        "limits": None if limits is None else _limits(model, limits),
        "contexts": contexts,
        "kinematics": None,
        "panels": panels,
        "path": _path_axes(model),
        "notes": notes,
    }
    if kinematics is not None:
        figure = stick_figure(model, kinematics, links)
        points = [p | {"coefficients": packed(p["coefficients"])} for p in figure["points"]]
        data["kinematics"] = figure | {"points": points}
    elif links is not None:
        raise value_error("links apply to the points of kinematics: pass kinematics too")
    return data


def tau_of(model: Model, conditions: Conditions) -> float:
    """Returns the time constant of conditions in linear time."""
    if conditions.segment_durations is None:
        return model.tau if conditions.tau is None else conditions.tau
    share = conditions.segment_durations.sum() / model.durations[model.nominal]
    return float(model.tau * share)


def _chosen(n: int, largest: int) -> list[int]:
    """Returns at most `largest` of n indices, at equal distances."""
    return [round(k) for k in np.linspace(0, n - 1, min(n, largest)).tolist()]


def _about(model: Model, recorded: bool) -> str:
    grey = "the reproductions of the demonstrations"
    if recorded:
        grey = "recorded positions, and velocities and paths of their reproductions"
    parts = [
        counted(model.n_demos, "demonstration"),
        counted(model.n_dofs, "degree") + " of freedom",
        counted(model.n_styles, "style"),
    ]
    return ", ".join(parts) + f", τ = {model.tau:.4g} s. Coloured: the movement; grey: {grey}."


def _time_note(model: Model) -> str:
    return (
        f"The model has {model.segment_durations.shape[1]} time segments. This page shows "
        "movements in linear time, for their total duration."
    )


def _layout(model: Model) -> dict[str, Any]:
    """Returns the columns of rotations and of the other coordinates, with their first DoF."""
    plain, rotations = [], []
    column = dof = 0
    while column < model.n_coordinates:
        if column in model.rotations:
            rotations.append({"column": column, "order": model.rotations[column], "dof": dof})
            column, dof = column + 4, dof + 3
        else:
            plain.append([column, dof])
            column, dof = column + 1, dof + 1
    return {"plain": plain, "rotations": rotations, "frame": model.rotation_frame}


def _demos(model: Model, chosen: list[int]) -> dict[str, Any]:
    """Returns the conditions of demonstrations, with the nominal one among them."""
    chosen = sorted({*chosen, model.nominal})
    centres = model.goals if model.kind == "discrete" else model.anchors
    taus = model.tau * model.durations[chosen] / model.durations[model.nominal]
    contexts = model.contexts
    names = [str(m) if contexts is None else f"{m} ({_listed(contexts[m])})" for m in chosen]
    return {
        "names": names,
        "numbers": chosen,
        "nominal": chosen.index(model.nominal),
        "styles": packed(model.styles[chosen]),
        "centres": packed(centres[chosen]),
        "starts": packed(model.starts[chosen]) if model.kind == "discrete" else None,
        "taus": packed(taus),
    }


def _listed(context: Sequence[float | str]) -> str:
    return ", ".join(c if isinstance(c, str) else f"{c:.4g}" for c in context)


def _recordings(
    model: Model, demonstrations: Sequence[Demonstration] | Mapping[str, Demonstration]
) -> list[dict[str, Any]]:
    """Returns times and positions of recordings for drawing, in single precision."""
    kinds = (Sequence, Mapping)
    check_type("demonstrations", demonstrations, kinds, "a list of demonstrations")
    if isinstance(demonstrations, Mapping):
        demonstrations = list(demonstrations.values())
    check_demonstrations(model, demonstrations)
    found = []
    n_numbers = MAX_RECORDED_BYTES // (4 * (model.n_coordinates + 1))
    chosen = _chosen(model.n_demos, min(MAX_RECORDED, n_numbers // MIN_RECORDED_SAMPLES + 1))
    n_kept = min(MAX_RECORDED_SAMPLES, n_numbers // len(chosen) + 2)
    for m in chosen:
        demo = demonstrations[m]
        time = sample_times(model, m, demo)
        kept = _chosen(len(time), n_kept)
        position = np.asarray(demo.position)[kept].astype(np.float32)
        found.append({"time": packed(time[kept].astype(np.float32)), "position": packed(position)})
    return found


def _limits(model: Model, limits: Limits) -> dict[str, list[float | None] | None]:
    """Returns limits per degree of freedom, None where there is none."""
    check_type("limits", limits, Limits, "pdmp.Limits")
    model.feasible(limits)  # rejects limits of another length
    lower, upper = limits.position or (None, None)

    def of(bound: NDArray[np.float64] | None) -> list[float | None] | None:
        if bound is None:
            return None
        values = np.broadcast_to(bound, model.n_dofs).tolist()
        return [value if np.isfinite(value) else None for value in values]

    return {
        "lower": of(lower),
        "upper": of(upper),
        "velocity": of(limits.velocity),
        "acceleration": of(limits.acceleration),
    }


def _panels(model: Model, dofs: Sequence[str | int] | None) -> list[int]:
    """Returns the indices of the coordinates that have diagrams at first."""
    names = model.coordinate_names
    if dofs is None:
        return list(range(min(len(names), MAX_PANELS)))
    if isinstance(dofs, str):
        raise value_error(f"dofs = {quoted(dofs)}: pass a list, [{quoted(dofs)}]")
    panels = []
    for dof in dofs:
        index = names.index(dof) if dof in names else dof
        if isinstance(index, bool) or not isinstance(index, int | np.integer):
            raise value_error(f"dofs has {quoted(dof)}: expected {quoted(names)} or their indices")
        if not 0 <= index < len(names):
            raise value_error(f"dofs has {index}: expected an index from 0 to {len(names) - 1}")
        panels.append(int(index))
    return sorted(set(panels))


def _path_axes(model: Model) -> list[int]:
    """Returns the quantities of the path: coordinates, or of a single one its velocity too."""
    n, units = model.n_coordinates, model.coordinate_units
    if n == 1:
        return [0, 1]
    spatial = n >= 3 and units[0] in LENGTHS and len(set(units[:3])) == 1
    return [0, 1, 2] if spatial else [0, 1]
