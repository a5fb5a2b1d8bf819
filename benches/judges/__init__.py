"""Independent judges of limits: klimits for states and accelerations, toppra for durations.

Run ``PYTHONPATH=benches python -m judges`` with klimits and toppra installed. Durations are those
of the recordings in PDMP_DATA, or of synthetic movements without it.
"""
