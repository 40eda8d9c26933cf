# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The table of the stress matrix (stress.py): outcomes by group and solver."""

from __future__ import annotations

from collections import Counter

from tables import table


def summary(records: list[dict]) -> str:
    """Table of outcomes by group and solver."""
    solvers, groups = (dict.fromkeys(r[key] for r in records) for key in ("solver", "group"))
    return table(["scenes", *solvers], [
        [group, *(_outcomes([r for r in records if r["solver"] == s and group in (r["group"], "all")]) for s in solvers)]
        for group in [*groups, "all"]
    ])  # fmt: skip


def _outcomes(records) -> str:
    count = Counter(r["outcome"] for r in records)
    others = "".join(f", {count[o]} {o}" for o in ("rounding", "WRONG") if count[o])
    return f"{count['solved']} / {len(records)}{others}" if records else "–"
