"""A demonstration on human handwriting: five shapes in one primitive, and what it can do."""

from pdmp.demo.run import run_demo

__all__ = ["run_demo"]
