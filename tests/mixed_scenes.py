"""Blocks in Taylor-Hood's mixed form, displacement and pressure, on planes."""

from types import SimpleNamespace

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from patches import LAME, MU, G, P, box, even_state, turned
from scenes import COMM

from dolfinx_contact import compat


def taylor_hood(domain, *more, pressure=("Lagrange", 1)):
    """Displacements of second order, pressures of first; ``more`` are further elements."""
    displacement = ("Lagrange", 2, (domain.geometry.dim,))
    return compat.mixed_functionspace(domain, [displacement, pressure, *more])


def held(W, facets, values=None, component=None):
    """A condition on displacements, or one of their components, at facets; ``values(x)``, None is zero."""
    part = W.sub(0) if component is None else W.sub(0).sub(component)
    whole, _ = part.collapse()
    where, value = (
        fem.locate_dofs_topological((part, whole), W.mesh.topology.dim - 1, facets),
        fem.Function(whole),
    )
    if values is not None:
        value.interpolate(values)
    return fem.dirichletbc(value, where, part), value


def elasticity(w, test, G, compliance, dx=ufl.dx, sign=1.0):
    """Internal virtual work of isotropic elasticity, ``p = lambda div u``; ``compliance`` is ``1 / lambda``."""
    (u, p), (v, q) = ufl.split(w), ufl.split(test)
    strain = ufl.sym(ufl.grad(u))
    work = 2 * G * ufl.inner(strain, ufl.sym(ufl.grad(v))) + p * ufl.div(v)
    return (work + sign * q * (ufl.div(u) - compliance * p)) * dx


def pressed(cell, slips, tilted, curved=False, solver=None, sign=1.0, **options):
    """A block under the tractions of an even stress, as ``patches.pressed``, in the mixed form."""
    domain, bottom, top = box(cell, curved=curved)
    d = domain.geometry.dim
    turn = turned(d) if tilted else np.eye(d)
    domain.geometry.x[:, :d] = domain.geometry.x[:, :d] @ turn.T
    W = taylor_hood(domain)
    w = fem.Function(W)
    gradient, traction, slip = even_state(d, slips)
    gradient, slip_ = turn @ gradient @ turn.T, turn @ slip
    strain = (gradient + gradient.T) / 2
    sigma = LAME * np.trace(strain) * np.eye(d) + 2 * G * strain
    bc, exact = held(W, top, lambda x: gradient @ x[:d] + slip_[:, None])
    sides = np.setdiff1d(mesh.exterior_facet_indices(domain.topology), np.union1d(bottom, top))
    tags = mesh.meshtags(domain, d - 1, sides, np.ones(sides.size, dtype=np.int32))
    ds = ufl.Measure("ds", domain=domain, subdomain_data=tags)(1)
    dx = ufl.dx(metadata={"quadrature_degree": 6}) if curved else ufl.dx
    test = ufl.TestFunction(W)
    load = fem.Constant(domain, sigma) * ufl.FacetNormal(domain)
    F = elasticity(w, test, G, 1 / LAME, dx, sign) - ufl.inner(load, ufl.split(test)[0]) * ds
    plane = dc.RigidPlane(np.zeros(d), turn[:, -1], turn[:, 0] if d == 3 else None)
    friction = dc.Friction(MU, P) if d == 3 else dc.Friction(MU[0])
    contact = dc.Contact(W, bottom, plane, friction)
    problem = dc.ContactProblem(F, w, contact, [bc], solver=solver, tol=1e-12, **options)
    step = problem.solve()
    pressure = LAME * np.trace(strain)
    return SimpleNamespace(
        w=w, contact=contact, problem=problem, exact=exact, traction=traction, slip=slip, step=step, mesh=domain,
        pressure=pressure,
    )  # fmt: skip


def block(
    n=4,
    compliance=0.02,
    mu=0.3,
    length=1.0,
    modulus=1.0,
    pressure=1.0,
    whole=True,
    load=None,
    confined=False,
    solver=None,
    tol=1e-8,
    comm=None,
    owners=None,
    **options,
):
    """A block of 2 by 1 on a plane in plane strain, its top moved by ``press(x, y)``, in shares of its height.

    Args:
        compliance: Shear modulus over lambda.
        length, modulus, pressure: Units; the last one of the unknown pressure alone, over the modulus.
        whole: Whether the top is held along the plane, too; else the side x = 0 is.
        confined: Whether the side x = 2 is held along x, too.
        owners: Partitioner; None is DOLFINx's.
        load: Force per volume, over modulus and length, of a block that nothing else holds than the plane.
    """
    corners, cells = [np.zeros(2), length * np.array([2.0, 1.0])], (2 * n, n)
    shared = {} if owners is None else {"partitioner": owners}
    domain = mesh.create_rectangle(comm or COMM, corners, cells, mesh.CellType.quadrilateral, **shared)  # fmt: skip
    bottom, top, side = (
        mesh.locate_entities_boundary(domain, 1, lambda x, i=i, at=at: np.isclose(x[i], at * length))
        for i, at in ((1, 0), (1, 1), (0, 0))
    )  # fmt: skip
    W = taylor_hood(domain)
    w, test = fem.Function(W), ufl.TestFunction(W)
    (u, p), (v, q) = ufl.split(w), ufl.split(test)
    strain, unit = ufl.sym(ufl.grad(u)), fem.Constant(domain, modulus * pressure)
    G, C = fem.Constant(domain, modulus), fem.Constant(domain, compliance / modulus)
    F = 2 * G * ufl.inner(strain, ufl.sym(ufl.grad(v))) + unit * p * ufl.div(v)
    F = (F + q * (ufl.div(u) - C * unit * p)) * ufl.dx
    bcs = [held(W, top)] if whole else [held(W, top, component=1), held(W, side, component=0)]
    if confined:
        far = mesh.locate_entities_boundary(domain, 1, lambda x: np.isclose(x[0], 2 * length))
        bcs.append(held(W, far, component=0))
    if load is not None:
        bcs, weight = [], fem.Constant(domain, modulus / length * np.array(load))
        F = F - ufl.inner(weight, v) * ufl.dx
    plane = dc.RigidPlane((0, 0), (0, 1))
    contact = dc.Contact(W, bottom, plane, dc.Friction(mu))
    problem = dc.ContactProblem(F, w, contact, [bc for bc, _ in bcs], solver=solver, tol=tol, **options)  # fmt: skip

    def press(*share):
        values = bcs[0][1].x.array
        if whole:
            values[:] = np.tile(length * np.array(share), values.size // 2)
        else:
            values[:] = length * share[-1]
        return problem.solve()

    return SimpleNamespace(
        w=w, W=W, F=F, contact=contact, problem=problem, press=press, mesh=domain
    )


def ring(
    bulk,
    mu=0.0,
    cells=(2, 8),
    steps=12,
    tol=1e-9,
    jacobian=False,
    pressure=("Lagrange", 1),
    volume=5,
):
    """Half a ring of rubber of shear modulus 1 between two planes, height down by 30 %; as ``rubber_seal`` in test_any_body.py.

    Args:
        bulk: Bulk modulus; None is incompressible.
        jacobian: Whether the change of volume is an unknown, too.
        pressure: Its element.
        volume: Degree to which what changes the volume is integrated.
    """
    kind = mesh.CellType.quadrilateral
    domain = mesh.create_rectangle(COMM, [np.zeros(2), np.ones(2)], cells, kind)

    def facets(where):
        return mesh.locate_entities_boundary(domain, 1, where)

    sides = [facets(lambda x, s=s: np.isclose(x[0], 1.0) & (s * (x[1] - 0.5) > 0.1)) for s in (1, -1)]  # fmt: skip
    ends = facets(lambda x: np.isclose(np.abs(x[1] - 0.5), 0.5))
    W = taylor_hood(domain, *([("Lagrange", 1)] if jacobian else []), pressure=pressure)
    middle, (whole, _) = W.sub(0).sub(1), W.sub(0).sub(1).collapse()
    dofs = fem.locate_dofs_geometrical((middle, whole), lambda x: np.isclose(x[1], 0.5))
    bcs = [held(W, ends, component=0)[0], fem.dirichletbc(fem.Function(whole), dofs, middle)]
    x = domain.geometry.x
    radius, angle = 0.6 + 0.4 * x[:, 0], np.pi * (x[:, 1] - 0.5)
    x[:, 0], x[:, 1] = radius * np.cos(angle), radius * np.sin(angle)
    w = fem.Function(W)
    u, p, *theta = ufl.split(w)
    gradient = ufl.Identity(2) + ufl.grad(u)
    J = ufl.det(gradient)
    energy = (ufl.tr(gradient.T * gradient) - 2 - 2 * ufl.ln(J)) / 2
    if jacobian:
        of_volume = p * (J - 1 - theta[0]) + bulk / 2 * theta[0] ** 2
    else:
        of_volume = p * (J - 1) - (0 if bulk is None else p**2 / (2 * bulk))
    dx = [ufl.dx(metadata={"quadrature_degree": degree}) for degree in (5, volume)]
    F = ufl.derivative(energy * dx[0] + of_volume * dx[1], w, ufl.TestFunction(W))
    contacts = []
    for side, mine in zip((1.0, -1.0), sides):
        normal = np.array([0.0, -side])
        contacts.append(dc.Contact(W, mine, dc.RigidPlane(-normal, normal), dc.Friction((mu, mu))))
    problem = dc.ContactProblem(F, w, contacts, bcs, tol=tol)
    steps = [problem_step(problem, contacts, depth) for depth in 0.3 * np.arange(1, steps + 1) / steps]  # fmt: skip
    return SimpleNamespace(problem=problem, contacts=contacts, w=w, steps=steps, J=J, mesh=domain)


def problem_step(problem, contacts, depth):
    """One step of planes that have moved inwards by a depth."""
    for contact in contacts:
        contact.plane.displacement = depth * contact.plane.normal
    return problem.solve()
