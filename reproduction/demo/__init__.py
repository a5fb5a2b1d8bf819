"""Demonstration on human handwriting: five shapes in one primitive."""
