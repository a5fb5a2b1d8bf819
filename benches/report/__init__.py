"""How well movements are foreseen from their context: the primitive beside simpler predictors."""
