# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What docs quote of the stress matrix (stress.py, by way of the report): outcomes by group, errors, seconds, methods."""

from __future__ import annotations

from collections import Counter

from quotes import table

UNTOUCHED = ("none:", "free")  # methods of steps in which no node touches


def summary(records: list[dict]) -> str:
    """Table of outcomes by group and solver."""
    solvers, groups = (dict.fromkeys(r[key] for r in records) for key in ("solver", "group"))
    return table(["scenes", *solvers], [
        [group, *(_outcomes([r for r in records if r["solver"] == s and group in (r["group"], "all")]) for s in solvers)]
        for group in [*groups, "all"]
    ])  # fmt: skip


def _outcomes(records) -> str:
    count = Counter(r["outcome"] for r in records)
    wrong = f", {count['WRONG']} WRONG" if count["WRONG"] else ""
    return f"{count['solved']} / {len(records)}{wrong}" if records else "–"


def claims(data: dict):
    """Texts by key, of a matrix that is whole; a part of it is not quoted."""
    if not data["whole"]:
        return
    records = [r for r in data["records"] if r["group"] != "singular stiffness"]
    yield "table", summary(records)
    yield "runs", str(len(records))
    yield "when", "; ".join(data["measured"])
    wrong = sum(r["outcome"] == "WRONG" for r in records)
    yield (
        "wrong",
        f"{wrong} answer{'s were' if wrong > 1 else ' was'} wrong"
        if wrong
        else "No answer was wrong",
    )
    for solver in dict.fromkeys(r["solver"] for r in records):
        of, key = [r for r in records if r["solver"] == solver], solver.replace(" ", "-")
        solved = [r for r in of if r["outcome"] == "solved"]
        refused = [r for r in of if r["outcome"] == "refused"]
        yield f"{key}.scenes", str(len(of))
        yield f"{key}.solved", str(len(solved))
        yield f"{key}.refused", "; ".join(f"{r['group']}: {r['name']}" for r in refused) or "none"
        yield f"{key}.steps", str(sum(r["steps"] for r in of))
        yield f"{key}.error", f"{max(r['error'] for r in solved):.1e}"
        worst = max(of, key=lambda r: r["slowest"])
        yield f"{key}.slowest", f"{worst['slowest']:.2f} s ({worst['group']}: {worst['name']})"
        methods = sum((Counter(r["methods"]) for r in of), Counter())
        touching = sum(n for method, n in methods.items() if method not in UNTOUCHED)
        if methods["newton"]:
            yield f"{key}.newton", f"{100 * methods['newton'] / touching:.0f} %"
