# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Tables of medians of cpp/benchmarks/bench_kernel.cpp, nanoseconds a node.

python benchmarks/kernel_table.py notes/records/kernel_bench.csv
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

from tables import ratio, table

LAWS = ["frictionless", "isotropic", "associated", "nonassociated"]
MAPS = ["scaled_map", "project", "bipotential_map", "return_map", "bipotential_gap"]
BRANCHES = ["open", "stick", "slip"]


def tables(text: str) -> list[str]:
    """Mixes of branches, each branch alone, and what was aimed at."""
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    of = {
        (row["flags"], row["map"], row["law"], row["branches"], int(row["nodes"])): row
        for row in csv.DictReader(lines)
    }

    def ns(*key) -> float:
        return float(of[key]["ns_per_node"])

    def triad(*key) -> float:
        return float(of[key]["fraction_of_triad"])

    def each(columns):
        for name in MAPS:
            for law in LAWS:
                yield [f"`{name}`" if law == LAWS[0] else "", law, *columns(name, law)]

    def mix(name, law):
        yield of["x86-64", name, law, "mix", 1000]["bytes_per_node"]
        for flags, nodes in (("x86-64", 10**3), ("x86-64", 10**6), ("x86-64", 10**7), ("native", 10**3), ("native", 10**6)):  # fmt: skip
            key = flags, name, law, "mix", nodes
            yield f"{ns(*key):.1f}" + (f" ({100 * triad(*key):.0f} %)" if nodes > 1000 else "")

    def alone(name, law):
        return [f"{ns('x86-64', name, law, b, n):.1f}" for n in (10**3, 10**6) for b in BRANCHES]

    plain, native = (ns(flags, "scaled_map", "nonassociated", "mix", 1000) for flags in ("x86-64", "native"))  # fmt: skip
    bound, bound_native = (1 / triad(flags, "scaled_map", "nonassociated", "mix", 10**6) for flags in ("x86-64", "native"))  # fmt: skip
    quartic = [ns("x86-64", "project", "nonassociated", "slip", n) for n in (10**3, 10**6)]
    cheaper = [
        ns("x86-64", name, "associated", "mix", 1000) / ns("x86-64", name, "frictionless", "mix", 1000)
        for name in ("scaled_map", "project")
    ]  # fmt: skip
    aims = [
        ("scaled map <= 10 ns per node in cache", f"{plain:.1f} (native {native:.1f})", plain <= 10),
        ("scaled map within 2x of memory bandwidth at n = 1e6",
         f"{ratio(bound)} times the triad (native {ratio(bound_native)})", bound <= 2),
        ("Euclidean quartic <= 60 ns per node, ratio 2, all nodes on it",
         f"{quartic[0]:.0f} in cache, {quartic[1]:.0f} at n = 1e6", max(quartic) <= 60),
        ("frictionless >= 3 times cheaper than orthotropic",
         f"{ratio(cheaper[0])} times (scaled map), {ratio(cheaper[1])} times (projection)", min(cheaper) >= 3),
    ]  # fmt: skip
    titles = ["map", "law"]
    sizes = ["B/node", "n = 1e3", "n = 1e6", "n = 1e7", "native, 1e3", "native, 1e6"]
    return [
        table([*titles, *sizes], each(mix)),
        table([*titles, *BRANCHES, *(f"{b}, 1e6" for b in BRANCHES)], each(alone)),
        table(["aim", "measured", ""], [(aim, found, "reached" if ok else "not reached") for aim, found, ok in aims]),
    ]  # fmt: skip


if __name__ == "__main__":
    print("\n\n".join(tables(Path(sys.argv[1]).read_text())))
