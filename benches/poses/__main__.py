"""Moves a tool and a box by primitives of poses on two simulated robots.

``make bench-poses`` prints the figures; ``--write`` writes docs/poses_in_simulation.md and its
pictures.
"""

import argparse
from pathlib import Path

import pdmp
from poses import box, panda
from poses.pictures import strip
from poses.text import text

DOCS = Path(__file__).resolve().parents[2] / "docs"
SEED = 2011
RUNS = [{"closed": closed, "held": held} for held in (False, True) for closed in (False, True)]
SHOWN = 2  # demonstration whose conditions the Panda moves by
PANDA_VIEW = (200.0, 1.45, (0.3, -0.2, 0.4))
BOX_VIEW = (160.0, 1.9, (0.40, 0.0, 0.15))


def main() -> None:
    """Measures the runs of both robots."""
    parser = argparse.ArgumentParser(prog="poses", description=__doc__)
    parser.add_argument("--write", action="store_true", help="write docs/poses_in_simulation.md")
    write = parser.parse_args().write
    pandas = {}
    for task, demos in panda.tasks().items():
        model = pdmp.fit(demos)
        runs = [panda.run(model, model.conditions(SHOWN), panda.NEAR[task], **run) for run in RUNS]
        pandas[task] = [record for _, record in runs]
        if write and task == "openbox":
            arm, record = runs[1]
            paths = [record.rows(name)[:, :3] for name in ("commanded", "measured")]
            strip(DOCS / "poses_panda.png", arm.model, record.states, paths, PANDA_VIEW)
    demos, *spread = box.demonstrations(SEED)
    model = pdmp.fit(demos)
    boxes = [box.carry(model, model.conditions(box.SHOWN), **run) for run in RUNS]
    report = text(pandas, boxes, (spread[0], spread[1]))
    print(report)
    if write:
        (DOCS / "poses_in_simulation.md").write_text(report, encoding="utf-8")
        strip(DOCS / "poses_box.png", box.scene().compile(), boxes[1].states, [], BOX_VIEW)


if __name__ == "__main__":
    main()
