"""Report on predictions of movements from their contexts, by primitives and simpler predictors."""
