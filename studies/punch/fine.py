# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The six cycles of the study on finer meshes: work of friction of each cycle, and where nodes stick at its ends.

``python -m studies.punch.fine FILE`` writes a table (CSV): the paper's mesh, and graded ones of second and first order, with the
paper's 15 increments a cycle and more.
"""

import csv
import sys
from dataclasses import replace
from pathlib import Path

import dolfinx_contact as dc
from studies.punch.limits import build, graded, uniform
from studies.punch.model import Parameters, programme

MESHES = {  # and how many times the paper's 15 increments a cycle has
    "paper": (uniform(8, order=1), (1, 4)),
    "graded 4": (graded(4), (1, 2, 4, 8)),
    "graded 6": (graded(6), (1, 2, 4)),
    "first order, graded 8": (graded(8, order=1), (1, 2)),
    "first order, graded 12": (graded(12, order=1), (1, 2)),
    "first order, graded 16": (graded(16, order=1), (1, 2)),
    "graded 8": (graded(8), (1, 2, 4)),
    "graded 10": (graded(10), (1, 2)),
}


def main(path: Path) -> None:
    with path.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(
            ["mesh", "factor", "case", "cycle", "work", "sticking_loaded", "sticking_unloaded"]
        )
        for name, (mesh, factors) in MESHES.items():
            punch, _ = build(mesh)
            start = replace(Parameters(), cycles=6)
            for factor in factors:
                for case in "ABC":
                    steps = dict(loading=factor * start.loading, unloading=factor * start.unloading)
                    punch.restart(case=case, cycles=6, **steps)
                    before, shares = 0.0, []
                    for number, displacement in enumerate(programme(punch.parameters), start=1):
                        punch.press(displacement)
                        within = number % sum(steps.values())
                        if within not in (0, steps["loading"]):
                            continue
                        contact = punch.contact
                        area = contact.area[contact.status == dc.Status.STICK].sum()
                        shares.append(
                            punch.comm.allreduce(area) / punch.comm.allreduce(contact.area.sum())
                        )
                        if within == 0:
                            work = punch.dissipation()
                            cycle = number // sum(steps.values())
                            table.writerow([name, factor, case, cycle, work - before, *shares])
                            file.flush()
                            before, shares = work, []


if __name__ == "__main__":
    main(Path(sys.argv[1]))
