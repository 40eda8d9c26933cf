"""How good ``dc.estimate`` is: estimated over true error, first against second order on the same mesh.

``PYTHONPATH=demos python -m benchmarks.effectivity`` prints a record a line; docs/accuracy.md has the table. True values are
closed forms; of partial slip those of second order on the finest mesh, of 64 cells. The paper's punch is
``studies.punch.effectivity``.
"""

import json

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import functionspace
from dolfinx_contact.discretisation import QUANTITIES

# isort: split
import demo_ball_on_flat as flat
import numpy as np
import ufl
from dolfinx import fem
from helpers import hooke, rounded_body, say


def ball_on_flat(scene, order: int) -> dc.ContactProblem:
    """The sphere of demo_ball_on_flat on a quarter of the block, pressed."""
    problem, contact = flat.ball_on_flat(*scene, order=order)
    contact.plane.displacement = (0, 0, -flat.DELTA)
    problem.solve()
    return problem


def sheared(scene, order: int) -> dc.ContactProblem:
    """A cylinder on a plane that goes sideways in four steps, and two back: partial slip."""
    domain, face, far = scene
    V = functionspace(domain, ("Lagrange", order, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    F = ufl.inner(hooke(ufl.sym(ufl.grad(u)), 1000.0, 0.3), ufl.sym(ufl.grad(v))) * ufl.dx
    stroke = 0.1**2 / 2000.0
    held = fem.Constant(domain, np.array([0.0, -3.0 * stroke]))
    bcs = [fem.dirichletbc(held, fem.locate_dofs_topological(V, 1, far), V)]
    contact = dc.Contact(V, face, dc.RigidPlane((0, 0), (0, 1)), dc.Friction(0.3))
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs, tol=1e-10)
    for way in (0.0, 0.2, 0.4, 0.6, 0.8, 0.6, 0.4):
        contact.plane.displacement = np.array([way * stroke, 0.0])
        problem.solve()
    return problem


def compare(name: str, cells: int, pair, true: dict) -> None:
    """Print values, estimates and effectivities."""
    found = dc.estimate(*pair)
    rows = {}
    for key, exact in true.items():
        of, miss = found[key], abs(found[key].value - exact)
        rows[key] = dict(
            error=miss / abs(exact), estimate=of.error / abs(exact), effectivity=of.error / miss
        )
    say(json.dumps(dict(scene=name, cells=cells, **rows)))


if __name__ == "__main__":
    for cells in (8, 12):
        scene = flat.scene(cells)
        pair = [ball_on_flat(scene, order) for order in (1, 2)]
        true = dict(normal_force=flat.FORCE / 4, peak_pressure=flat.P0)
        compare("ball on flat, 3-D", cells, pair, true)
    scenes = {cells: rounded_body(1000.0, 0.1, 1.6, cells, order=2) for cells in (8, 16, 32, 64)}
    finest = sheared(scenes[64], 2)
    true = {key: of(finest) for key, of in QUANTITIES.items()}
    for cells in (8, 16, 32):
        compare(
            "partial slip, 2-D", cells, [sheared(scenes[cells], order) for order in (1, 2)], true
        )
