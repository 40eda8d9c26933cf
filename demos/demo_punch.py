# %% [markdown]
# # The paper's punch
#
# A steel cylinder stands on a plane with grooves; its top face moves down and up again. Poisson's effect drives the
# contact nodes outwards, against friction that differs along and across the grooves. As in [dSFMH07, Section 3], there are
# stick zones, outward slip and, on unloading, reverse slip. This demo writes numbers, a picture and ParaView
# files; the scene itself is in `studies/punch`, so it runs from the root of the clone: `python -m demos.demo_punch`,
# with options (try `--help`), on any number of MPI ranks. As a notebook it needs that root on the path: start Jupyter
# there with `PYTHONPATH=$PWD`. In an environment of your own: `pip install -e .` first.
#
# ## Notation
#
# $u$ displacement, $\sigma$ stress, $E$, $\nu$ elastic constants; $r = (r_t, r_n)$ reaction of the plane on the body,
# $x_n$ gap, $\Delta u_t$ slip increment of a step; $M = \mathrm{diag}(\mu_x, \mu_y)$, $P = \mathrm{diag}(p_x, p_y)$.
# Units: mm, N, MPa.
#
# ## Strong form
#
# $$ -\operatorname{div} \sigma(u) = 0, \qquad u = (0, 0, -\delta) \text{ on the top face}, $$
#
# and on the bottom face $x_n \ge 0$, $r_n \ge 0$, $x_n r_n = 0$, $|M^{-1} r_t| \le r_n$, and where there is slip
# [dSFMH07, Section 1]
#
# $$ |M^{-1} r_t| = r_n, \qquad -\Delta u_t = \lambda\, P^{-2} r_t, \quad \lambda \ge 0. $$
#
# ## Weak form
#
# $$ \int_\Omega \sigma(u) : \varepsilon(v) \,\mathrm{d}x = \sum_{\text{contact nodes}} r \cdot v, $$
#
# hexahedra of first order, one load step after another. With `--accuracy 0.01` they are of second order, and refined
# until an estimate of the error of the forces and of the frictional work, extrapolated to small increments, is below one
# per cent (`docs/study.md`).
#
# ## Code

# %%
import argparse
import json
import logging
import sys
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter, process_time

from tqdm import tqdm

import dolfinx_contact as dc

# isort: split
import ufl

from studies.punch import CASES, Parameters, Punch, programme
from studies.punch.accuracy import NotAccurate, accurate
from studies.punch.contact_map import draw, gather
from studies.punch.model import add_options

SOLVERS = {
    "auto": lambda: None,
    "fixed-point": dc.FixedPoint,
    "paper": lambda: dc.FixedPoint(map="bipotential"),
    "condensed": dc.CondensedNewton,
}
HEAD = "  step    d [mm]   normal [N]  tangential [N]   open stick  slip   error  iter.  seconds"
ROW = (
    "{step:6d}{displacement:10.4f}{normal_reaction:13.1f}{tangential_reaction_sum:16.1f}"
    "{open:7d}{stick:6d}{slip:6d}{error:8.0e}{iterations:7d}{seconds:9.3f}"
)


def run(punch: Punch) -> Iterator[dict]:
    """Compute the whole programme with a progress bar; yields the record of each step."""
    hidden = True if punch.comm.rank != 0 else None  # None: where there is no terminal
    label = f"case {punch.parameters.case}"
    with tqdm(programme(punch.parameters), label, disable=hidden) as bar:

        def show(iteration, error, counts):
            state = f"{-punch.approach.value:.3f} mm, iteration {iteration}, error {error:.0e}"
            bar.set_postfix_str(f"{state}, {{}} open, {{}} stick, {{}} slip".format(*counts))

        punch.problem.monitor = show
        for displacement in bar:
            yield punch.press(displacement)


# %% [markdown]
# ## Result
#
# The table of all steps. Above in the picture: where $f = |M^{-1} r_t| - r_n$ is negative the node sticks; below:
# pressure and friction. While loading, the centre sticks and the rest slips outwards; on unloading the rim sticks,
# then slips inwards.


# %%
def arguments(argv=None) -> argparse.Namespace:
    defaults = argparse.ArgumentDefaultsHelpFormatter
    says = "The punch of [dSFMH07, Section 3], on any number of MPI ranks; the scene is in studies/punch."
    parser = argparse.ArgumentParser(description=says, formatter_class=defaults)
    add = parser.add_argument
    add("--case", choices=CASES, default="C", help="friction, Table 1 of the paper")
    add_options(parser)
    add("--unload-to", type=float, default=Parameters.unload_to, help="end of unloading, mm")
    add("--point", type=float, nargs=2, metavar=("X", "Y"), help="P, mm; 3/4 R at 45 degrees")
    add("--lowest", type=float, help="height of elements on the plane, mm; else all are as high")
    add("--accuracy", type=float, metavar="PART", help="of frictional work and forces: mesh, order and increments are chosen, "
        "--refine, --lowest and --solver are not used; estimated, see docs/study.md")  # fmt: skip
    add("--solver", choices=SOLVERS, default="auto", help="paper: fixed point with its own map")
    add("--json", type=Path, metavar="FILE", help="numbers of all steps; DIR/punch.json")
    add("--output", type=Path, metavar="DIR", default=Path("results/punch"), help="what is written")
    return parser.parse_args(argv)


def main(argv=None) -> None:
    """Compute, print the table, write numbers, picture and ParaView files."""
    begin = perf_counter()
    logging.disable(logging.INFO)  # DOLFINx 0.5 logs each call of the C compiler in a first run
    options = vars(arguments(argv))
    output, solver = options.pop("output"), SOLVERS[options.pop("solver")]()
    json_file = options.pop("json") or output / "punch.json"
    accuracy = options.pop("accuracy")
    parameters = Parameters(**{**options, "point": options["point"] and tuple(options["point"])})
    last = len(programme(parameters)) - 1
    loaded = last - parameters.unloading
    shown = {loaded: "loaded", (loaded + last) // 2: "unloading", last: "unloaded"}
    output.mkdir(parents=True, exist_ok=True)
    if accuracy is None:
        numbers, punch, maps, failure = compute(parameters, solver, shown, output)
    else:
        numbers, punch, maps, failure = compute_accurately(parameters, accuracy, shown)
    head, records = punch.head(), numbers["steps"]
    numbers |= {"seconds": perf_counter() - begin, "processor_seconds": process_time()}
    if punch.comm.rank == 0:
        if accuracy is not None:
            rows = [ROW.format(step=step, **record) for step, record in enumerate(records, start=1)]
            print(HEAD, *rows, sep="\n")
        json_file.parent.mkdir(parents=True, exist_ok=True)
        json_file.write_text(json.dumps({"head": head} | numbers, indent=1) + "\n")
        print(f"\nnumbers   {json_file}")
        if accuracy is None:
            print(f"ParaView  {output / 'punch.pvd'}")
        else:
            print("frictional work {dissipation:.2f} N mm, {increments:+.2f} of it for smaller increments, estimated error "
                  "{dissipation_error:.1e}, of forces {force_error:.1e}, {seconds:.3g} s".format(**numbers))  # fmt: skip
        if maps:
            title = "Punch, case {case}: $\\mu$ = {friction[mu]}, $p$ = {friction[p]}".format(**head)  # fmt: skip
            title += f"; cycle {parameters.cycles}; x to the right, y up"
            draw(maps, title, output / "punch.png", head["point"])
            print(f"picture   {output / 'punch.png'}")
    if failure:
        sys.exit(failure if punch.comm.rank == 0 else 1)


def tell(punch: Punch, line: str) -> None:
    """Print at once on rank 0, into a file, too, past the progress bar."""
    if punch.comm.rank == 0:
        tqdm.write(line)
        sys.stdout.flush()


def compute(parameters, solver, shown, output) -> tuple:
    """Numbers, punch, discs to draw, and the reason if a step failed: one run on the mesh that the parameters name."""
    punch, records, maps, failure = Punch(parameters, solver=solver), [], [], None
    sigma = punch.stress(punch.u)
    von_Mises = ufl.sqrt(1.5 * ufl.inner(ufl.dev(sigma), ufl.dev(sigma)))
    fields = {"stress": sigma, "von_Mises": von_Mises}
    writer = dc.Writer(punch.problem, output / "punch.pvd", fields=fields)
    tell(punch, HEAD)
    try:
        for index, record in enumerate(run(punch)):
            records.append(record)
            tell(punch, ROW.format(step=index + 1, **record))
            writer.write(index + 1)
            if index in shown:
                maps.append((f"{shown[index]}, {record['displacement']:g} mm", gather(punch)))
    except dc.NotConverged as error:  # what was computed before is kept
        failure = f"Step {len(records) + 1}: {error}"
    return {"dissipation": punch.dissipation(), "steps": records}, punch, maps, failure


def compute_accurately(parameters, accuracy, shown) -> tuple:
    """The same on meshes and with increments that are refined until the estimated error is small enough."""
    failure = None
    try:
        found = accurate(parameters, accuracy, shown)
    except NotAccurate as error:
        found, failure = error.found, str(error)
    names = ("dissipation", "increments", "dissipation_error", "force_error", "tried")
    numbers = {name: getattr(found, name) for name in names} | {"steps": found.records}
    return numbers, found.punch, found.maps, failure


if __name__ == "__main__":
    inside = "ipykernel" in sys.modules  # there the command line is the notebook's
    main([] if inside else None)
    if inside:
        from IPython.display import Image, display

        display(Image("results/punch/punch.png"))
