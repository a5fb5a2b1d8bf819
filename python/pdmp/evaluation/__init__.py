"""How well movements are foreseen from their context, measured on demonstrations held out."""

from pdmp.evaluation.baselines import (
    Components,
    LinearWeights,
    MeanDemonstration,
    MovedGoal,
    NearestDemonstration,
    PeerWeights,
    ProcessWeights,
    RadialWeights,
)
from pdmp.evaluation.predictors import PDMP, Forecast, Predictor
from pdmp.evaluation.recordings import Recordings
from pdmp.evaluation.result import Comparison, Evaluation, Scores, Summary
from pdmp.evaluation.run import baselines, evaluate, over_styles
from pdmp.evaluation.splits import Split

__all__ = [
    "PDMP",
    "Comparison",
    "Components",
    "Evaluation",
    "Forecast",
    "LinearWeights",
    "MeanDemonstration",
    "MovedGoal",
    "NearestDemonstration",
    "PeerWeights",
    "Predictor",
    "ProcessWeights",
    "RadialWeights",
    "Recordings",
    "Scores",
    "Split",
    "Summary",
    "baselines",
    "evaluate",
    "over_styles",
]
