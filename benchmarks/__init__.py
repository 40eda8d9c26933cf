"""Measurements; each program runs from the root of the clone: ``python -m benchmarks.NAME --help``."""
