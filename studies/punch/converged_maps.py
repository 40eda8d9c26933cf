# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Stick and slip of the first unloading: the paper's mesh beside a converged one, at the instants of the study's page.

``python -m studies.punch.converged_maps PICTURE TABLE`` draws them for A, B, C (PNG of 64 colours), and writes the shares of the area that
stick and slip inwards (CSV), also on a finer mesh.  On one rank.
"""

import csv
import sys
from io import BytesIO
from pathlib import Path

from matplotlib import rc_context
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from PIL import Image

from studies.punch.contact_map import LEGEND, STICK, ContactMap, draw_zones, gather, mirrored
from studies.punch.limits import build, graded, uniform
from studies.punch.model import Parameters, programme

SHOWN = (0, 1, 4, 7, 10)  # of ten steps of the first unloading
# Mesh and times the paper's increments.
MESHES = {
    "the paper's mesh": (uniform(8, order=1), 1),
    "graded, second order, n = 6": (graded(6), 4),
}


def maps(run, times: int, shown=SHOWN) -> dict[str, list[ContactMap]]:
    """The disc of each case after the steps of the paper's unloading that are shown."""
    punch, _ = build(run)
    found, start = {}, Parameters()
    for case in "ABC":
        punch.restart(case=case, loading=times * start.loading, unloading=times * start.unloading)
        wanted = [times * (start.loading + k) for k in shown]
        found[case] = []
        for number, displacement in enumerate(programme(punch.parameters), start=1):
            punch.press(displacement)
            if number in wanted:
                found[case].append(mirrored(gather(punch)))
    return found


def draw(found: dict[str, dict[str, list[ContactMap]]], file: Path) -> None:
    """One row for each case and mesh; ``found`` by mesh and case."""
    cases = list(next(iter(found.values())))
    with rc_context({"font.size": 13, "hatch.linewidth": 0.6}):
        figure = Figure(figsize=(14.5, 3.0 * len(cases) * len(found) + 1.2), layout="constrained")
        axes = figure.subplots(len(cases) * len(found), len(SHOWN), squeeze=False)
        rows = [(case, mesh) for case in cases for mesh in found]
        for line, (case, mesh) in zip(axes, rows, strict=True):
            for ax, disc, k in zip(line, found[mesh][case], SHOWN, strict=True):
                image = draw_zones(ax, disc)
                for collection in ax.collections:
                    collection.set_rasterized(not isinstance(collection, LineCollection))
                ax.set_title(
                    f"{case}: {mesh}" if k == 0 else f"{k} of {SHOWN[-1]} steps", fontsize=11
                )
        figure.colorbar(
            image, ax=axes, label="load function $f$ / mean pressure", extend="min", shrink=0.4
        )
        figure.legend(**LEGEND)
        drawn = BytesIO()
        figure.savefig(drawn, dpi=70)
    Image.open(drawn).convert("RGB").quantize(64, dither=Image.Dither.NONE).save(
        file, optimize=True
    )


def shares(found: dict[str, dict[str, list[ContactMap]]]):
    """Of the area, what sticks and what slips inwards, by mesh, case and instant."""
    for mesh, cases in found.items():
        for case, discs in cases.items():
            for k, disc in zip(SHOWN, discs, strict=True):
                area = disc.area()
                of = [
                    area[which].sum() / area.sum()
                    for which in (disc.status == STICK, disc.inward())
                ]
                yield mesh, case, k, *(f"{share:.4f}" for share in of)


def main(picture: Path, record: Path) -> None:
    found = {name: maps(run, times) for name, (run, times) in MESHES.items()}
    draw(found, picture)
    found["graded, second order, n = 8"] = maps(graded(8), 4)  # is what was drawn converged?
    with record.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["mesh", "case", "step", "sticks", "slips_inwards"])
        table.writerows(shares(found))


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
