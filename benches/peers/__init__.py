"""pdmp beside its peers: the same work, side by side, in one run.

``make bench-peers`` installs the peers and runs this. Contestants take turns, bout by bout, so that
a machine that slows down slows all of them; garbage collection is off, and BLAS has the one thread
that the Makefile gives it. Whoever has taken some seconds takes part in no further bout of a work.
A bout of many calls is run twice: first with every call timed separately, which gives p99.9 and the
worst and finds the caches as the others left them; then with twenty timed together, so that the
clock costs nothing, which gives the median. Ratios are those of the medians.
"""
