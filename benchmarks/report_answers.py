# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What an accuracy costs: which mesh, increments and tolerance, and how many seconds, from measured families.

The errors of mesh, increments and tolerance are added, though they may have opposite signs.  Beyond the last mesh and the last
increments both errors and seconds follow their last measured rates; what rests on that is marked as extrapolated.
"""

from __future__ import annotations

from scipy.optimize import brentq

FARTHEST = 12  # halvings beyond what was measured that are looked at
KEY = "dissipation"


def richardson(widths, values) -> tuple[float | None, float | None]:
    """Limit and order p of the last three values, ``value = limit + c width^p``, the widths in any ratios.

    Where they do not go one way, or no p between 0.3 and 5 fits, there is no order and the finest is the limit.
    """
    if len(values) < 3:
        return (values[-1] if values else None), None
    (h1, h2, h3), (a, b, c) = widths[-3:], values[-3:]
    if (b - a) * (c - b) <= 0:
        return c, None

    def defect(p):
        return (b - a) / (c - b) - (h2**p - h1**p) / (h3**p - h2**p)

    if defect(0.3) * defect(5.0) > 0:
        return c, None
    order = float(brentq(defect, 0.3, 5.0))
    return c + (c - b) * h3**order / (h2**order - h3**order), order


def answers(families: dict, orders: dict) -> list[dict]:
    """For 1 % and 0.1 % in the work of friction: the cheapest single run, and Richardson's limit where it is enough."""
    if any(len(families[family]) < 2 for family in families):
        return []
    chains = {f: chain(families[f], orders[f].get(KEY)) for f in ("meshes", "increments")}
    found = []
    for percent in (1.0, 0.1):
        run = cheapest(chains, families["tolerances"], percent / 100)
        limits = by_limits(families)
        text = f"For {percent:g} %: " + "; ".join(
            part for part in (_of_run(run), _of_limits(limits, percent)) if part
        )
        found.append(dict(percent=percent, run=run, limits=limits, text=text + "."))
    return found


def chain(rows: list[dict], order: float | None) -> list[dict]:
    """Error and seconds of the measured rows, then of halvings beyond the last one at the last rates."""
    known = [
        dict(error=row[f"{KEY}_error"], seconds=row["seconds"]["median"], beyond=0,
            unknowns=row["unknowns"], increments=row["increments"])
        for row in rows if row[f"{KEY}_error"] is not None
    ]  # fmt: skip
    if order is None or len(known) < 2:
        return known
    last, before = known[-1], known[-2]
    rates = {key: last[key] / before[key] for key in ("seconds", "unknowns", "increments")}
    for k in range(1, FARTHEST + 1):
        known.append(
            dict(beyond=k, error=last["error"] * 0.5 ** (order * k))
            | {key: last[key] * rate**k for key, rate in rates.items()}
        )
    return known


def cheapest(chains: dict, tolerances: list[dict], wanted: float) -> dict | None:
    """The run of fewest seconds whose three errors add up to no more than is wanted."""
    tight, base = tolerances[-1]["seconds"]["median"], chains["increments"][0]["seconds"]
    best = None
    for mesh in chains["meshes"]:
        for time in chains["increments"]:
            for row in tolerances:
                error = mesh["error"] + time["error"] + (row[f"{KEY}_error"] or 0.0)
                seconds = mesh["seconds"] * time["seconds"] / base * row["seconds"]["median"] / tight  # fmt: skip
                if error <= wanted and (best is None or seconds < best["seconds"]):
                    best = dict(error=error, seconds=seconds, unknowns=mesh["unknowns"], increments=time["increments"],
                        tol=row["tol"], beyond=[mesh["beyond"], time["beyond"]])  # fmt: skip
    return best


def by_limits(families: dict) -> dict | None:
    """Richardson's limits from three meshes and three increments, judged by how far the next three move them.

    None if the next ones were not measured or there is no order.
    """
    error, seconds, used = 0.0, 0.0, []
    for family in ("meshes", "increments"):
        rows = families[family]
        widths = [row["x"] if family == "meshes" else 1 / row["x"] for row in rows]
        values = [row[KEY] for row in rows]
        (first, order), (second, next_order) = richardson(widths[:3], values[:3]), richardson(widths, values)  # fmt: skip
        if len(rows) < 4 or order is None or next_order is None:
            return None
        error += abs(first / second - 1)
        seconds += sum(row["seconds"]["median"] for row in rows[:3])
        used.append([row["unknowns" if family == "meshes" else "increments"] for row in rows[:3]])
    seconds -= families["increments"][0]["seconds"]["median"]  # the paper's run is in both
    return dict(error=error, seconds=seconds, unknowns=used[0], increments=used[1])


def _of_run(run: dict | None) -> str:
    if run is None:
        return "no single run within sight"
    beyond = " (extrapolated, not run)" if any(run["beyond"]) else ""
    return (
        f"a single run needs {_thousands(run['unknowns'])} unknowns, {run['increments']:.0f} increments a cycle, tolerance "
        f"{run['tol']:g}: about {_time(run['seconds'])}{beyond}"
    )


def _of_limits(limits: dict | None, percent: float) -> str:
    if limits is None:
        return ""
    enough = "are enough" if 100 * limits["error"] <= percent else "are not enough"
    return (
        f"Richardson's limits from the meshes of {', '.join(map(_thousands, limits['unknowns']))} unknowns and from "
        f"{', '.join(map(str, limits['increments']))} increments {enough} (the next mesh and increments move them by "
        f"{100 * limits['error']:.2g} %): {_time(limits['seconds'])}, measured"
    )


def _thousands(count: float) -> str:
    return f"{count:,.0f}" if count < 1e6 else f"{count:.1e}"


def _time(seconds: float) -> str:
    units = ("s", 1), ("minutes", 60), ("hours", 3600), ("days", 86400)
    unit, size = next((u for u in units if seconds < 100 * u[1]), ("years", 365.25 * 86400))
    return f"{seconds / size:.2g} {unit}"
