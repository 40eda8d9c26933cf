# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The paper's cylindrical punch as an O-grid of hexahedra, built by gmsh.

Seen from below, a square core of ``divisions`` x ``divisions`` quadrilaterals and four blocks of
as many around it; extruded in ``layers`` layers.  With 8 and 4 these are the 1280 hexahedra,
1685 nodes and 337 contact nodes of [dSFMH07, Section 3]; how the paper divided its disc is not in
its text, but a core and four blocks of 8 x 8 is the only O-grid with these numbers.
"""

import math

import gmsh
import numpy as np
from scipy.optimize import brentq

from dolfinx_contact.compat import model_to_mesh

CONTACT, TOP = 1, 2  # tags of the facets z = 0 and z = height
CORE = 0.5 * 1.15  # half of the core's side over that of the square in the circle


def punch_mesh(
    comm, refine=0, *, radius=10.0, height=10.0, divisions=8, layers=4, lowest=None, order=1, rim=None, quarter=False,
    tetrahedra=False
):  # fmt: skip
    """Mesh of a punch standing on z = 0, its axis along z, distributed over ``comm``.

    Args:
        comm: MPI communicator; gmsh runs on its rank 0.
        refine: Each level doubles ``divisions`` and ``layers``, a negative one halves them; 0 is the paper's mesh.
        radius, height: Of the punch, length units.
        divisions: Quadrilaterals along each side of each of the five blocks; even in first order: the axis is a line of nodes.
        layers: Hexahedra along the height.
        lowest: Height of those on the plane, from where they grow by the same factor; None: all are as high.
        order: 2 for bricks of 27 nodes whose outer faces are curved: a circle is one, to the fourth order.
        rim: Width of the quadrilaterals at the rim over that of their block; inwards they grow by the same factor.
        quarter: Only the part x, y > 0, of half as many quadrilaterals along the core's sides; ``divisions`` must be even.
        tetrahedra: Six in place of each hexahedron, on the same nodes in second order.

    Returns:
        A record with ``mesh`` and ``facet_tags`` (CONTACT, TOP), as DOLFINx's ``model_to_mesh``.
    """
    divisions, layers = divisions * 2.0**refine, layers * 2.0**refine
    if divisions < 2 or divisions * order % 2 or layers < 1 or layers % 1:
        raise ValueError("divisions must be even (whole in second order) and >= 2, layers whole and >= 1; with refine "
                         f"{refine!r} they are {divisions:g} and {layers:g}.")  # fmt: skip
    if quarter and divisions % 2:
        raise ValueError(f"divisions must be even for a quarter, got {divisions:g}.")
    if not (0 < radius < math.inf and 0 < height < math.inf):
        raise ValueError(f"radius and height must be positive, got {radius!r} and {height!r}.")
    if rim is not None and not 0 < rim * divisions < 1:
        raise ValueError(f"rim must be less than a {divisions:g}th, got {rim!r}.")
    if lowest is not None and not 0 < lowest * layers < height:
        raise ValueError(f"lowest must be less than a {layers:g}th of the height, got {lowest!r}.")
    gmsh.initialize()
    try:
        if comm.rank == 0:
            gmsh.option.setNumber("General.Terminal", 0)
            gmsh.model.add("punch")
            shares = _layers(int(layers), lowest and lowest / height) | dict(
                recombine=not tetrahedra
            )
            growth = 1.0 if rim is None else math.exp(_growth(int(divisions), rim))
            build = _build_quarter if quarter else _build
            build(height / radius, int(divisions), growth, **shares)
            gmsh.model.mesh.setOrder(order)
        punch = model_to_mesh(gmsh.model, comm, 0, gdim=3)
    finally:
        gmsh.finalize()
    punch.mesh.geometry.x[:] *= radius
    return punch


def _layers(count, lowest):
    """What gmsh is told of the layers; ``lowest`` over the height."""
    if lowest is None:
        return dict(numElements=[count])
    growth = _growth(count, lowest)
    tops = np.expm1(growth * np.arange(1, count)) / math.expm1(growth * count)
    return dict(numElements=[1] * count, heights=[*tops, 1.0])


def _growth(count, smallest):
    """Logarithm of the factor by which ``count`` lengths grow whose sum is 1."""

    def excess(growth):
        return smallest * math.expm1(growth * count) / math.expm1(growth) - 1

    return brentq(excess, 1e-9, -math.log(smallest))


def _build(height, divisions, growth, **layers):
    """The punch of radius 1 (gmsh's tolerances are absolute), every block transfinite."""
    geo = gmsh.model.geo
    rim = 1 / math.sqrt(2)
    core = CORE * rim
    corners = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
    centre = geo.addPoint(0, 0, 0)
    inner = [geo.addPoint(core * x, core * y, 0) for x, y in corners]
    outer = [geo.addPoint(rim * x, rim * y, 0) for x, y in corners]
    sides = [geo.addLine(inner[i - 1], inner[i]) for i in range(4)]
    arcs = [geo.addCircleArc(outer[i - 1], centre, outer[i]) for i in range(4)]
    spokes = [geo.addLine(inner[i], outer[i]) for i in range(4)]

    loops = [sides] + [[spokes[i - 1], arcs[i], -spokes[i], -sides[i]] for i in range(4)]
    for curve in sides + arcs:
        geo.mesh.setTransfiniteCurve(curve, divisions + 1)
    for curve in spokes:
        geo.mesh.setTransfiniteCurve(curve, divisions + 1, "Progression", 1 / growth)
    _extrude(height, loops, centre, **layers)


def _build_quarter(height, divisions, growth, **layers):
    """The part x, y > 0: a quarter of the core and the halves of two blocks."""
    geo = gmsh.model.geo
    rim = 1 / math.sqrt(2)
    core = CORE * rim
    centre = geo.addPoint(0, 0, 0)
    inner = [geo.addPoint(x, y, 0) for x, y in ((core, 0), (core, core), (0, core))]
    outer = [geo.addPoint(x, y, 0) for x, y in ((1, 0), (rim, rim), (0, 1))]
    way = [centre, *inner]
    sides = [geo.addLine(way[i - 1], way[i]) for i in range(4)]
    arcs = [geo.addCircleArc(outer[i], centre, outer[i + 1]) for i in range(2)]
    spokes = [geo.addLine(inner[i], outer[i]) for i in range(3)]
    loops = [[sides[1], sides[2], sides[3], sides[0]]]
    loops += [[spokes[i], arcs[i], -spokes[i + 1], -sides[i + 2]] for i in range(2)]
    for curve in sides + arcs:
        geo.mesh.setTransfiniteCurve(curve, divisions // 2 + 1)
    for curve in spokes:
        geo.mesh.setTransfiniteCurve(curve, divisions + 1, "Progression", 1 / growth)
    _extrude(height, loops, None, **layers)


def _extrude(height, loops, spare, recombine, **layers):
    """The mesh over the plane blocks within the loops; ``spare`` is a point of no element, or None."""
    geo = gmsh.model.geo
    blocks = [geo.addPlaneSurface([geo.addCurveLoop(loop)]) for loop in loops]
    for block in blocks:
        geo.mesh.setTransfiniteSurface(block)
        if recombine:
            geo.mesh.setRecombine(2, block)
    # extrude answers, for each surface, its copy, the volume and the sides
    extruded = [geo.extrude([(2, b)], 0, 0, height, recombine=recombine, **layers) for b in blocks]
    geo.synchronize()
    if spare is not None:
        gmsh.model.removeEntities([(0, spare)])  # or it would be meshed as a node of no element

    gmsh.model.addPhysicalGroup(2, blocks, CONTACT)
    gmsh.model.addPhysicalGroup(2, [copy[1] for copy, *_ in extruded], TOP)
    gmsh.model.addPhysicalGroup(3, [volume[1] for _, volume, *_ in extruded], 1)
    gmsh.model.mesh.generate(3)
