"""Cross-validation of predictions of movements from their contexts."""

from pdmp.evaluation.baselines import (
    Components,
    Encoding,
    LinearWeights,
    MeanDemonstration,
    MovedGoal,
    NearestDemonstration,
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
    "Encoding",
    "Evaluation",
    "Forecast",
    "LinearWeights",
    "MeanDemonstration",
    "MovedGoal",
    "NearestDemonstration",
    "Predictor",
    "RadialWeights",
    "Recordings",
    "Scores",
    "Split",
    "Summary",
    "baselines",
    "evaluate",
    "over_styles",
]
