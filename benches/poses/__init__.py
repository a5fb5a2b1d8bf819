"""Primitives of poses on two simulated robots; see `__main__`."""
