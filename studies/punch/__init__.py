# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The cyclic punch of [dSFMH07, Section 3]: the scene (model, mesh), what is computed (run) and what is shown of it."""

from studies.punch.model import CASES, Parameters, Punch, programme

__all__ = ["CASES", "Parameters", "Punch", "programme"]
