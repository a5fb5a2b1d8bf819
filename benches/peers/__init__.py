"""Benchmarks of pdmp and other libraries on the same tasks, in one run.

``make bench-peers`` installs the libraries and runs this. The libraries alternate, round by round,
so that a machine that slows down slows all of them. Garbage collection is off, and BLAS uses one
thread, set in the Makefile. A library that has taken some seconds is left out of further rounds of
a task. A round of many calls is run twice: first with every call timed separately, which gives
p99.9 and the maximum with the caches as the other libraries left them; then with twenty calls timed
together, so that reading the clock is negligible, which gives the median. Ratios are those of the
medians.
"""
