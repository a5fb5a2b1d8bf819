"""Runs an example, and saves an explorer of its first model as NAME.html."""

import runpy
import sys
from pathlib import Path

import pdmp

script = Path(sys.argv[1])
names = runpy.run_path(str(script), run_name="__main__")
model = next((value for value in names.values() if isinstance(value, pdmp.Model)), None)
if model is not None:
    model.explorer(f"{script.stem}.html", title=f"Model of {script.name}")
