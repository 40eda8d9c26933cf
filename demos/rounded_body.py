"""A body with a rounded face on the line y = 0, in two dimensions, for the demos of curved bodies.

The face is the parabola y = x^2 / (2 R), as in the theory of Hertz. The mesh is finest where it touches,
with quadrilaterals that grow towards the far boundary; no mesh generator is needed.
"""

from __future__ import annotations

import dolfinx_contact as dc  # noqa: F401  before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
from dolfinx import mesh


def rounded_body(
    comm, radius: float, contact: float, size: float, cells: int, half=False, crossed=False
):
    """Quadrilaterals on -size < x < size (half: 0 < x < size), y above the face and below ``size``.

    Their width grows like ``cosh(x / fine)``; ``fine`` is such that a quarter of them are within
    ``contact``, and a node is at that place.

    Args:
        comm: MPI communicator.
        radius: R of the face, length units.
        contact: Expected half width of the contact.
        size: Half width and height of the body, more than four times ``contact``.
        cells: Cells from the middle to the side, and as many over the height; a multiple of four.
        half: Only the half x > 0, for symmetry.
        crossed: Each quadrilateral is cut into four triangles by its diagonals; in first order these
            do not lock when the material hardly changes its volume [B. Mercier, RAIRO Anal. Numer. 13
            (1979) 117], provided that the diagonals are straight.

    Returns:
        The mesh; the indices of the facets of the rounded face within twice ``contact``, and of the
        far boundary, which is all the rest but the face and the line x = 0 of a half.
    """
    # sinh(y) = contact / fine and sinh(4 y) = size / fine: a cubic for cosh(y)
    cosh = np.roots([8, 0, -4, -size / contact]).real.max()
    fine = contact / np.sqrt(cosh**2 - 1)
    low = 0.0 if half else -1.0
    domain = mesh.create_rectangle(
        comm,
        [np.array([low, 0.0]), np.array([1.0, 1.0])],
        [cells if half else 2 * cells, cells],
        mesh.CellType.triangle if crossed else mesh.CellType.quadrilateral,
        diagonal=mesh.DiagonalType.crossed,
    )
    width = np.arcsinh(2 * contact / fine) / np.arcsinh(size / fine)
    face = mesh.locate_entities_boundary(
        domain, 1, lambda x: np.isclose(x[1], 0.0) & (np.abs(x[0]) < width)
    )

    def far(x):
        return np.isclose(x[1], 1.0) | np.isclose(x[0], 1.0) | np.isclose(x[0], -1.0)

    far_boundary = mesh.locate_entities_boundary(domain, 1, far)
    x = domain.geometry.x
    lines = np.linspace(-1.0, 1.0, 2 * cells + 1)
    x[:, :2] = np.interp(x[:, :2], lines, fine * np.sinh(np.arcsinh(size / fine) * lines))
    x[:, 1] += (1 - x[:, 1] / size) * x[:, 0] ** 2 / (2 * radius)
    return domain, face, far_boundary


def along_face(contact, *arrays):
    """Positions x of all contact nodes, sorted, and the rows of ``arrays`` with them, on every rank."""
    order = None
    for array in (contact.x[:, 0], *arrays):
        everywhere = np.concatenate(contact.comm.allgather(array))
        order = np.argsort(everywhere, kind="stable") if order is None else order
        yield everywhere[order]
