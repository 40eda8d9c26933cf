# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The study of [dSFMH07, Section 3]: six cycles of cases A, B and C, all figures on one page.

Every step is kept; a study that was stopped continues where it was, and one with other numbers
begins anew.  With --explore also what the paper's text leaves open: ends of unloading, support of
the top face, increments, mesh.  The page is OUTPUT/study.html.  Runs on any number of MPI ranks.
"""

import argparse
import logging
import sys
from dataclasses import replace
from pathlib import Path

from mpi4py import MPI
from tqdm import tqdm

from studies.punch.model import CASES, Parameters, add_options, programme
from studies.punch.run import Run, compute

COMM = MPI.COMM_WORLD


def variants(base: Parameters, options) -> dict[str, Parameters]:
    """What the paper leaves open, one change at a time; on other meshes one cycle."""
    cycles = options.explore_cycles
    few = replace(base, cycles=cycles)
    ends = [low for low in options.explore_unload_to if low != base.unload_to]
    runs = {f"unload to {low:g} mm": replace(few, unload_to=low) for low in ends}
    deeper = tuple(base.depth * (0.6 - 0.4 * k / max(cycles - 1, 1)) for k in range(cycles))
    runs["deeper every cycle"] = replace(few, unload_to=deeper)
    runs["top free"] = replace(few, top="free")
    for factor in (2, 4):
        more = dict(loading=factor * base.loading, unloading=factor * base.unloading)
        runs["{loading}+{unloading} increments".format(**more)] = replace(few, **more)
    if options.divisions * 2**base.refine % 4 == options.layers * 2**base.refine % 2 == 0:
        runs["mesh coarsened"] = replace(base, cycles=1, refine=base.refine - 1)
    for level in range(1, options.explore_refine + 1):
        runs[f"mesh refined {level}x"] = replace(base, cycles=1, refine=base.refine + level)
    return runs


def plan(options) -> dict[str, dict[str, Parameters]]:
    """Parameters by variant and case; the paper's own programme is ``base``."""
    ends, names = options.unload_to, ("cycles", "loading", "unloading", "top", "tol", "refine")
    base = Parameters(
        unload_to=tuple(ends) if len(ends) > 1 else ends[0],
        point=tuple(options.point[0]) if options.point else None,
        **{name: getattr(options, name) for name in names},
    )
    runs = {"base": base} | (variants(base, options) if options.explore else {})
    cases = options.cases
    return {name: {case: replace(of, case=case) for case in cases} for name, of in runs.items()}


def compute_all(runs, output: Path, points, mesh_options):
    """Compute what is missing; complete runs by variant and case, on rank 0, and those that did not converge."""
    complete, failures = {}, []
    total = sum(len(programme(p)) for cases in runs.values() for p in cases.values())
    hidden = True if COMM.rank != 0 else None  # None: where there is no terminal
    with tqdm(total=total, unit="step", disable=hidden, smoothing=0.1) as bar:
        for name, cases in runs.items():
            for case, parameters in cases.items():
                bar.set_description(f"case {case}, {name}")
                directory = output / "runs" / name.replace(" ", "_") / case
                reason = compute(parameters, directory, points, bar, **mesh_options)
                if reason:  # a variant less, not a study less
                    failures.append({"variant": name, "case": case, "not_converged": reason})
                elif COMM.rank == 0:
                    complete.setdefault(name, {})[case] = Run(directory)
    return complete, failures


def arguments(argv=None) -> argparse.Namespace:
    defaults = argparse.ArgumentDefaultsHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=defaults)
    add = parser.add_argument
    add("--cases", nargs="+", choices=CASES, default=list(CASES), help="Table 1 of the paper")
    add_options(parser, cycles=6)
    unload_to = dict(type=float, nargs="+", metavar="MM")
    add("--unload-to", **unload_to, default=[Parameters.unload_to], help="one end, or one a cycle")
    add("--divisions", type=int, default=8, help="of the sides of the mesh's blocks")
    add("--layers", type=int, default=4, help="of the mesh")
    add("--point", type=float, nargs=2, action="append", metavar=("X", "Y"),
        help="P, mm (default: 3/4 R at 45 degrees); again for more tracked nodes")  # fmt: skip
    add("--wear-coefficient", type=float, default=3e-8, metavar="K",
        help="worn volume per work of friction, mm^3/(N mm)")  # fmt: skip
    add("--explore", action="store_true", help="compute what the paper leaves open, too")
    add("--explore-cycles", type=int, default=3, help="cycles of its variants")
    add("--explore-unload-to", **unload_to, default=[0.0, 0.01, 0.02, 0.05], help="its unloadings")
    add("--explore-refine", type=int, default=1, help="its finer meshes; each costs ten times more")
    add("--data-only", action="store_true", help="compute, but draw nothing and write no page")
    add("--output", type=Path, metavar="DIR", default=Path("results/study"), help="what is written")
    return parser.parse_args(argv)


def main(argv=None) -> None:
    logging.disable(logging.INFO)  # DOLFINx 0.5 logs each call of the C compiler in a first run
    options = arguments(argv)
    mesh_options = dict(divisions=options.divisions, layers=options.layers)
    more_points = [tuple(point) for point in (options.point or [])[1:]]
    runs, failures = compute_all(plan(options), options.output, more_points, mesh_options)
    said = ["{variant}, case {case}, {not_converged}".format(**failure) for failure in failures]
    if any(failure["variant"] == "base" for failure in failures):
        sys.exit("\n".join(said) if COMM.rank == 0 else 1)
    if options.data_only or COMM.rank != 0:
        return
    from studies.punch.report import report  # draws: not needed by the other ranks

    print(*said, "drawing", sep="\n")
    report(runs, options.output, options.wear_coefficient, failures)
    print(f"page      {options.output / 'study.html'}\nfigures   {options.output / 'figures'}")


if __name__ == "__main__":
    main()
