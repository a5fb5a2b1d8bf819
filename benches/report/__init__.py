"""Prediction of movements from their context: the primitive and simpler predictors."""
