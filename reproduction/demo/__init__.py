"""A demonstration on human handwriting: five shapes in one primitive."""
