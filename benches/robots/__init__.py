"""Joint limits on two simulated robots; see `__main__`."""
