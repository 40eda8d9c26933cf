"""How good the estimate of the discretisation's error is on the punch: first against second order on the same mesh.

``python -m studies.punch.effectivity CASE DIVISIONS LAYERS`` prints one record: the estimate of every quantity after loading
and after the first cycle.  The true error needs a limit, see docs/accuracy.md.
"""

import json
import sys
from dataclasses import replace
from time import process_time

import dolfinx_contact as dc
from dolfinx_contact.discretisation import QUANTITIES
from studies.punch.accuracy import FACTORISED
from studies.punch.model import Parameters, Punch, programme


def measure(case: str, divisions: int, layers: int, tol: float = 1e-8) -> dict:
    """Values and estimated errors of first order on a mesh of ``divisions`` and ``layers``.  Collective."""
    parameters = replace(Parameters(), case=case, tol=tol)
    mesh = dict(divisions=divisions, layers=layers)
    pair, seconds = [], []
    for order in (1, 2):
        start = process_time()
        options = dict(mesh, petsc_options=FACTORISED, order=order)
        pair.append(Punch(parameters, solver=dc.CondensedNewton(), **options))
        seconds.append(process_time() - start)
    loading, found = parameters.loading, {}
    ends = {loading: "loaded", loading + parameters.unloading: "unloaded"}
    for number, displacement in enumerate(programme(parameters), start=1):
        for which, punch in enumerate(pair):
            start = process_time()
            punch.press(displacement)
            seconds[which] += process_time() - start
        if name := ends.get(number):
            of = dc.estimate(*(punch.problem for punch in pair))
            found[name] = {key: [q.value, q.error] for key, q in of.quantities.items()}
            found[name]["reference"] = {
                key: quantity(pair[1].problem) for key, quantity in QUANTITIES.items()
            }
    return dict(case=case, divisions=divisions, layers=layers, seconds=seconds, **found)


if __name__ == "__main__":
    print(json.dumps(measure(sys.argv[1], *map(int, sys.argv[2:4]))), flush=True)
