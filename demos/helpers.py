"""What the demos share: where they print and draw, Hooke's law, a body with a rounded face, a quarter of a block."""

import sys
from importlib.util import find_spec
from pathlib import Path

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import functionspace, second_order

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

COMM = MPI.COMM_WORLD


def say(text: str) -> None:
    """Print on rank 0."""
    if COMM.rank == 0:
        print(text, flush=True)  # also into a file


def picture(draw, *data) -> None:
    """Call ``draw(figure, *data)`` and show the figure in a notebook; a script writes it to its argument, if any."""
    inside = "ipykernel" in sys.modules
    if COMM.rank != 0 or not inside and len(sys.argv) < 2:
        return
    from matplotlib import pyplot

    figure = pyplot.figure(figsize=(6, 3.2), layout="constrained")
    draw(figure, *data)
    if inside:
        pyplot.show()
    else:
        figure.savefig(sys.argv[1], dpi=165)


def picture_of_body(problem) -> None:
    """Beside the picture that a script writes, ``body.png``: body, contact nodes and surfaces in space, with PyVista."""
    if sys.argv[1:] and sys.argv[1].endswith(".png") and find_spec("pyvista"):
        dc.plot(problem, Path(sys.argv[1]).with_name("body.png"))


def on_all_ranks(*arrays) -> list[np.ndarray]:
    """Rows of all ranks, on every rank."""
    return [np.concatenate(COMM.allgather(array)) for array in arrays]


def hooke(strain, E: float, nu: float):
    """Stress of a strain; of a strain in two dimensions that of plane strain."""
    lame, shear = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    return lame * ufl.tr(strain) * ufl.Identity(strain.ufl_shape[0]) + 2 * shear * strain


def rounded_body(radius, contact, size, cells: int, half=False, crossed=False, order=1):
    """A body with the face y = x^2 / (2 radius), as in the theory of Hertz, in two dimensions.

    Widths of its quadrilaterals grow like ``cosh(x / fine)``; ``fine`` is such that a quarter of them are within
    ``contact``, and a node is at that place.

    Args:
        radius: Of the face, length units.
        contact: Expected half width of the contact.
        size: Half width and height of the body, more than four times ``contact``.
        cells: Cells from the middle to the side, and as many over the height; a multiple of four.
        half: Only the half x > 0, for symmetry.
        crossed: Each quadrilateral is cut into four triangles by its diagonals; in first order these do not lock
            when the material hardly changes its volume [B. Mercier, RAIRO Anal. Numer. 13 (1979) 117].
        order: Of the cells' geometry; with 2 their edges are curved, for displacements of second order.

    Returns:
        The mesh; the facets of the face within twice ``contact``; those of the far boundary, the sides and the top.
    """
    # sinh(y) = contact / fine and sinh(4 y) = size / fine: a cubic for cosh(y)
    cosh = np.roots([8, 0, -4, -size / contact]).real.max()
    fine = contact / np.sqrt(cosh**2 - 1)
    corners = [np.array([0.0 if half else -1.0, 0.0]), np.ones(2)]
    across = cells if half else 2 * cells
    kind = mesh.CellType.triangle if crossed else mesh.CellType.quadrilateral
    diagonal = mesh.DiagonalType.crossed
    domain = mesh.create_rectangle(COMM, corners, [across, cells], kind, diagonal=diagonal)
    domain = second_order(domain) if order == 2 else domain
    width = np.arcsinh(2 * contact / fine) / np.arcsinh(size / fine)

    def on_face(x):
        return np.isclose(x[1], 0.0) & (np.abs(x[0]) < width)

    def is_far(x):
        return np.isclose(x[1], 1.0) | np.isclose(np.abs(x[0]), 1.0)

    face, far = (mesh.locate_entities_boundary(domain, 1, where) for where in (on_face, is_far))
    x = domain.geometry.x
    lines = np.linspace(-1.0, 1.0, 2 * cells + 1)
    x[:, :2] = np.interp(x[:, :2], lines, fine * np.sinh(np.arcsinh(size / fine) * lines))
    x[:, 1] += (1 - x[:, 1] / size) * x[:, 0] ** 2 / (2 * radius)
    return domain, face, far


def along_face(contact, *arrays) -> list[np.ndarray]:
    """Positions x of all contact nodes, sorted, and the rows of ``arrays`` with them, on every rank."""
    x, *arrays = on_all_ranks(contact.x[:, 0], *arrays)
    order = np.argsort(x, kind="stable")
    return [array[order] for array in (x, *arrays)]


def quarter_block(cells: int, size: float, grading, near):
    """A quarter of a block below z = 0, its hexahedra fine at the origin: widths along axis k grow like ``cosh(n_k s)``.

    Args:
        cells: Along each edge.
        size: Of the edges, length units.
        grading: ``n`` of each axis.
        near: Half lengths along x and y of the rectangle on the top that may touch.

    Returns:
        The mesh; the facets that may touch; those at x = 0, at y = 0, and far away.
    """
    domain = mesh.create_unit_cube(COMM, cells, cells, cells, mesh.CellType.hexahedron)
    x, n = domain.geometry.x, np.array(grading)
    x[:, 2] = 1 - x[:, 2]
    x[:] = size * np.sinh(n * x) / np.sinh(n) * (1, 1, -1)

    def touching(y):
        return np.isclose(y[2], 0.0) & (y[0] < near[0]) & (y[1] < near[1])

    def far(y):
        return np.isclose(y[0], size) | np.isclose(y[1], size) | np.isclose(y[2], -size)

    places = (touching, lambda y: np.isclose(y[0], 0.0), lambda y: np.isclose(y[1], 0.0), far)
    return domain, *(mesh.locate_entities_boundary(domain, 2, where) for where in places)


def point_force_field(x, force: float, E: float, nu: float):
    """Displacement of a half space z < 0 under a point force down at the origin, ``shape=(3, points)``."""
    r, z = np.hypot(x[0], x[1]), -x[2]
    rho = np.hypot(r, z)
    rho[rho == 0] = 1.0  # inside the contact, where the value is not used
    b = force * (1 + nu) / (2 * np.pi * E * rho)
    outwards = b * (z / rho**2 - (1 - 2 * nu) / (rho + z))
    return np.array([outwards * x[0], outwards * x[1], -b * (2 * (1 - nu) + z**2 / rho**2)])


def elastic(domain, E: float, nu: float, order: int = 1):
    """Space, displacement and weak form of a body in three dimensions."""
    V = functionspace(domain, ("Lagrange", order, (3,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    return V, u, ufl.inner(hooke(ufl.sym(ufl.grad(u)), E, nu), ufl.grad(v)) * ufl.dx


def quarter_supports(V, left, front, far, field) -> list:
    """Symmetry at x = 0 and y = 0; far away the displacement ``field``, a function of the coordinates."""
    held, zero = fem.Function(V), fem.Constant(V.mesh, 0.0)
    held.interpolate(field)
    bcs = [fem.dirichletbc(held, fem.locate_dofs_topological(V, 2, far))]
    for k, facets in enumerate((left, front)):
        dofs = fem.locate_dofs_topological(V.sub(k), 2, facets)
        bcs.append(fem.dirichletbc(zero, dofs, V.sub(k)))
    return bcs
