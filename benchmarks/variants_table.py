# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What docs/method.md and docs/variants.md quote of the records of variants.py: tables, iterations, differences between solutions."""

from __future__ import annotations

from quotes import measured, ratio, table

AS_IT_IS, WITHOUT, ALONE = "as it is", ", without the tangent", "Newton's method alone, "
FIRST_UNLOADING = 5  # the steps before are those of loading


def claims(parts: dict) -> dict[str, str]:
    """Texts by part and key; ``when`` says when, on what and at which load all of them were measured."""
    found = {}
    for part, quoted in QUOTED.items():
        if part in parts:
            found |= {f"{part}.{key}": text for key, text in quoted(parts[part]["rows"]).items()}
    if parts.keys() >= {"unloading", "unloading-fine"}:
        found |= _unloading(*({row["name"]: row for row in parts[part]["rows"]} for part in ("unloading", "unloading-fine")))  # fmt: skip
    return found | {"when": measured(parts.values())}


def percent(value: float) -> str:
    """A difference as a reader wants it: two digits."""
    return f"{ratio(100 * value)} %"


def spread(rows, key: str) -> float:
    """Largest difference of a number over the largest one."""
    values = [row[key] for row in rows]
    return (max(values) - min(values)) / max(map(abs, values))


# -- whole cycles --------------------------------------------------------------------------------------


def _cycle(row) -> tuple[str, str]:
    """Iterations of all steps and of the worst one, or where it ended."""
    if row["refused"] is not None:
        return f"refused in step {len(row['steps']) + 1}", f"{row['refused']:.0e}"
    return str(row["iterations"]), str(max(row["steps"]))


def _iterations(rows):
    cells = {(row["case"], row["name"]): _cycle(row) for row in rows}
    maps = ("return", "bipotential")
    lines = [
        [case, *(f"{cells[case, map][k]} ({cells[case, map + WITHOUT][k]})" for map in maps for k in (0, 1))]
        for case in dict.fromkeys(row["case"] for row in rows)
    ]  # fmt: skip
    titles = ["case", '`map="return"`, the default', "worst step", '`map="bipotential"`', "worst step"]  # fmt: skip
    return {"table": table(titles, lines)}


def _increments(rows):
    return {key: "{} iterations, at most {} a step".format(*_cycle(row)) if row["refused"] is None
        else f"refused in step {len(row['steps']) + 1} at {row['refused']:.0e}"
        for key, row in zip(("with", "without"), rows)}  # fmt: skip


def _pairs(rows):
    """Cycles as they are and with the variant, case by case."""
    built_in, changed = rows[::2], rows[1::2]
    return {
        "as-it-is": " and ".join(_cycle(row)[0] for row in built_in),
        "changed": " and ".join(_cycle(row)[0] for row in changed),
    }


# -- a hard step ---------------------------------------------------------------------------------------


def _steps(row) -> str:
    if row is None:
        return "–"
    return f"{row['iterations']}" if row["solved"] else f"not in {row['iterations']}: {row['error']:.0e}"  # fmt: skip


def _unloading(coarse, fine):
    """The first unloading on two meshes; those of Newton's method alone in a table of their own."""
    lines, newton = [], []
    for name, row in coarse.items():
        if name.startswith(ALONE):
            newton.append([name.removeprefix(ALONE), _steps(row), _steps(fine.get(name))])
        elif not name.endswith(WITHOUT):
            over = [ratio(of[name]["seconds"] / of[AS_IT_IS]["seconds"]) if name in of else "–" for of in (coarse, fine)]  # fmt: skip
            lines.append([name, _steps(coarse.get(name + WITHOUT)), _steps(row), over[0], _steps(fine.get(name)), over[1]])  # fmt: skip
    usual = coarse[AS_IT_IS]
    same = [row["seconds"] / usual["seconds"] for row in coarse.values() if row["error"] == usual["error"]]  # fmt: skip
    meshes = [f"{of[AS_IT_IS]['unknowns']:,}" for of in (coarse, fine)]
    titles = ["variant", f"{meshes[0]}: without the tangent", "with it", "seconds", f"{meshes[1]}: with it", "seconds"]  # fmt: skip
    return {
        "unloading.table": table(titles, lines),
        "unloading.scatter": f"{ratio(min(same))} to {ratio(max(same))}",
        "unloading-fine.without": _steps(fine[AS_IT_IS + WITHOUT]),
        "newton.table": table(["Newton's method", *meshes], newton),
    }  # fmt: skip


def _raised(rows):
    """A larger step, with Newton's method and without."""
    lines = [
        [row["name"], _steps(row), ratio(row["seconds"] / rows[0]["seconds"]), f"{row['tangential']:.2f}" if row["solved"] else "–"]
        for row in rows
    ]  # fmt: skip
    titles = ["rule", "iterations", "seconds", "sum of tangential forces (N)"]
    return {"table": table(titles, lines), "unknowns": f"{rows[0]['unknowns']:,}"}


# -- bodies of the stress matrix -----------------------------------------------------------------------


def _count(rows) -> list[int]:
    """Refused, or wrong; and iterations."""
    return [sum(row["outcome"] != "solved" for row in rows), sum(row["iterations"] for row in rows)]


def _springs(rows):
    lines = []
    for spring in dict.fromkeys(row["name"].split()[1] for row in rows):
        of = [row for row in rows if row["name"].split()[1] == spring]
        alone, balanced = ([row for row in of if row["variant"] == v] for v in ("alone", "balanced"))  # fmt: skip
        lines.append([spring, len(balanced), *_count(alone), *_count(balanced)])
    titles = ["spring over E", "scenes", "refused without", "iterations without", "refused", "iterations"]  # fmt: skip
    solved = [row for row in rows if row["variant"] == "balanced" and row["outcome"] == "solved"]
    return {
        "table": table(titles, lines),
        "confirmed": f"{len(solved)} of {sum(line[1] for line in lines)}",
        "error": f"{max(row['error'] for row in solved):.1e}",
    }


def _rules(rows):
    lines = []
    for variant in dict.fromkeys(row["variant"] for row in rows):
        refused, iterations = _count([row for row in rows if row["variant"] == variant])
        lines.append([variant, iterations, refused])
    scenes = len(rows) // len(lines)
    return {"table": table(["rule", "iterations", "refused"], lines), "scenes": str(scenes)}


# -- solutions -----------------------------------------------------------------------------------------


def _agreement(rows):
    return {key: f"{max(row[key] for row in rows):.1e}" for key in ("nodal", "totals")}


def _two(rows):
    lines = [
        [k, f"`{row['solver']}`", row["iterations"], f"{row['judged']:.1e}", f"{row['stick']}, {row['slip']}",
         f"{row['normal_reaction']:.2f}, {row['tangential_reaction_sum']:.2f}"]
        for k, row in enumerate(rows, start=1)
    ]  # fmt: skip
    titles = ["", "found by", "iterations", "error by the judge", "sticking, slipping", "sum of normal, of tangential forces (N)"]  # fmt: skip
    of = rows[0]
    return {
        "table": table(titles, lines),
        "where": ", ".join(f"({x:.2f}, {y:.2f})" for x, y, _ in of["where"]),
        "apart": percent(of["apart"]),
        "beyond": str(of["beyond"]),
        "slips": percent(of["slips_apart"]),
    }


def _by(step, name: str) -> str:
    """What a map of the fixed point finds in a step."""
    of = step["by"][name]
    if of["number"] is None:
        return f"none ({of['error']:.0e} after {of['iterations']} iterations)"
    new = "a further one" if of["number"] >= step["by_newton"] else "one of them"
    return f"{new} in {of['iterations']} iterations"


def _block(steps):
    last = steps[-1]
    found = last["solutions"]
    sticking = [row["stick"] for row in found]
    return {
        "solutions": str(last["by_newton"]),
        "starts": str(last["starts"]),
        "nodes": str(last["nodes"]),
        "error": f"{max(row['error'] for row in found[: last['by_newton']]):.0e}",
        "fixed-point": _by(last, "fixed point"),
        "paper": _by(last, "fixed point, paper's map"),
        "stick": f"{min(sticking)} to {max(sticking)}",
        "apart": percent(max(row["apart"] for row in found)),
        "slips": percent(max(row["slips_apart"] for row in found)),
        **{key: percent(spread(found, key)) for key in ("normal", "tangential")},
        "work": ratio(max(row["work"] for row in found) / min(row["work"] for row in found)),
    }


def _programme(steps):
    loading, unloading = steps[:FIRST_UNLOADING], steps[FIRST_UNLOADING:]
    starts = sum(step["starts"] for step in steps)
    hits = sum(row["hits"] for step in steps for row in step["solutions"])
    return {
        "nodes": str(steps[0]["nodes"]),
        "starts": str(starts),
        "each": str(max(step["starts"] for step in steps)),
        "converged": str(hits),
        "most": str(max(len(step["solutions"]) for step in steps)),
        "loading": str(max(len(step["solutions"]) for step in loading)),
        "unloading": ", ".join(str(len(step["solutions"])) for step in unloading),
        "by-fixed-point": str(sum(len(step["solutions"]) - step["by_newton"] for step in steps)),
        "refused": str(sum(of["number"] is None for step in steps for of in step["by"].values())),
        "apart": percent(max(row["apart"] for step in steps for row in step["solutions"])),
        "tangential": percent(max(spread(step["solutions"], "tangential") for step in steps)),
        "error": f"{max(row['error'] for step in steps for row in step['solutions']):.0e}",
    }  # fmt: skip


def _height(rows):
    """How the surface of a half-space resists waves of slip, by the height of its elements."""
    titles = ["height over width", *(f"{wave:g}" for wave in rows[0]["waves"])]
    return {
        "table": table(titles, [[f"{row['height']:g}", *(f"{x:.3f}" for x in row["resistance"])] for row in rows]),
        "angle": f"{rows[0]['angle']:.1f}",
        "stable": f"{max(row['height'] for row in rows if min(row['resistance']) > 0):g}",
        "worst": f"{min(min(row['resistance']) for row in rows):.2f}",
    }  # fmt: skip


QUOTED = {
    "iterations": _iterations,
    "increments": _increments,
    "agreement": _agreement,
    "springs": _springs,
    "balanced": _pairs,
    "rules": _rules,
    "two": _two,
    "block": _block,
    "coarse": _programme,
    "paper": _programme,
    "order": _pairs,
    "raised": _raised,
    "height": _height,
}
