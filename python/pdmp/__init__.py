"""Parametric dynamic movement primitives: one primitive learnt from many demonstrations.

From several demonstrations of one skill, `fit` learns a single dynamical system with a few style
parameters that move between and around them. `Model.rollout` plans, `Model.controller` runs inside
a control loop.

References
----------
T. Matsubara, S.-H. Hyon, J. Morimoto, "Learning parametric dynamic movement primitives from
multiple demonstrations", Neural Networks 24 (2011), https://doi.org/10.1016/j.neunet.2011.02.004
"""

from importlib import import_module as _import_module
from typing import TYPE_CHECKING as _TYPE_CHECKING

from pdmp._limits import Limits
from pdmp._native import (
    GP,
    AdditionalForcing,
    BlockStyles,
    Conditions,
    ContextMap,
    Continuation,
    Controller,
    Controllers,
    Demonstration,
    Estimate,
    FactorisedFit,
    Factors,
    FitError,
    GPRegression,
    Margins,
    Model,
    ModelFileError,
    NGnet,
    NGnetRegression,
    PartialFit,
    Passage,
    PdmpError,
    Prediction,
    Prior,
    Recogniser,
    RolloutChunks,
    Status,
    StyleProjection,
    TimeWarp,
    Trajectory,
    ViaPoint,
    __version__,
    blend,
    factorise,
    fit,
    load,
)
from pdmp.realtime import PacedLoop, Tick

if _TYPE_CHECKING:
    from pdmp import autodiff, datasets, evaluation, io, plot, preprocessing, robots
    from pdmp._distributed import fit_distributed
    from pdmp.evaluation import evaluate
else:

    def __getattr__(name: str) -> object:
        """Imports modules that a control loop does not need at their first use."""
        if name == "evaluate":
            return _import_module("pdmp.evaluation").evaluate
        if name == "fit_distributed":
            return _import_module("pdmp._distributed").fit_distributed
        if name in ("autodiff", "datasets", "evaluation", "io", "plot", "preprocessing", "robots"):
            return _import_module(f"pdmp.{name}")
        raise AttributeError(f"module 'pdmp' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(__all__)


__all__ = [
    "GP",
    "AdditionalForcing",
    "BlockStyles",
    "Conditions",
    "ContextMap",
    "Continuation",
    "Controller",
    "Controllers",
    "Demonstration",
    "FactorisedFit",
    "Estimate",
    "Factors",
    "FitError",
    "GPRegression",
    "Limits",
    "Margins",
    "Model",
    "ModelFileError",
    "NGnet",
    "NGnetRegression",
    "PacedLoop",
    "Passage",
    "PartialFit",
    "PdmpError",
    "Prediction",
    "Prior",
    "Recogniser",
    "RolloutChunks",
    "Status",
    "StyleProjection",
    "Tick",
    "TimeWarp",
    "Trajectory",
    "ViaPoint",
    "__version__",
    "autodiff",
    "blend",
    "datasets",
    "evaluate",
    "evaluation",
    "factorise",
    "fit",
    "fit_distributed",
    "io",
    "load",
    "plot",
    "preprocessing",
    "robots",
]
