"""Solvers of a load step, each bound to a body and its contacts."""
