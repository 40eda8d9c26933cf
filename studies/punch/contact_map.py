# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Pictures of the contact disc on the mesh's own faces: no interpolation that invents zones."""

from typing import NamedTuple

from studies.punch.mesh import CONTACT

# isort: split
import numpy as np
from dolfinx import fem
from matplotlib import colormaps, rc_context
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from scipy.spatial import ConvexHull

OPEN, STICK, SLIP, REVERSE = 0, 1, 2, 3
ZONES = {  # orange, blue and hatching: for all eyes, and in black and white
    STICK: dict(facecolor="#4a90c4", edgecolor="black", label="stick, $f<0$"),
    SLIP: dict(facecolor="#f0a33a", edgecolor="#f0a33a", label="slip outwards, $f=0$"),
    REVERSE: dict(facecolor="#c25700", edgecolor="#c25700", label="slip inwards, $f=0$"),
    OPEN: dict(facecolor="white", edgecolor="#888888", hatch="////", label="open"),
}
# Blue up to f = 0, as in the legend.
STICKING = ListedColormap(colormaps["Blues_r"](np.linspace(0, 0.72, 256)))
HANDLES = [Patch(**style) for style in ZONES.values()]
LEGEND = dict(handles=HANDLES, loc="outside lower center", ncols=4, frameon=False)


VALUES = ("reaction", "slip_increment", "status", "load_function")  # of nodes


class ContactMap(NamedTuple):
    """The contact disc with all its nodes on one rank; rows of nodes and of faces in any order."""

    x: np.ndarray  # (n, 2) mm
    faces: np.ndarray  # (m, 4) nodes of the quadrilaterals, counter-clockwise
    reaction: np.ndarray  # (n, 3) N, local frame
    slip_increment: np.ndarray  # (n, 2) mm
    status: np.ndarray  # (n,)
    load_function: np.ndarray  # (n,) N
    # (n,) mm^2; None: that of the quarters, as good in first order
    nodal_area: np.ndarray | None = None

    def quarters(self) -> np.ndarray:
        """Four quarters of each face, ``shape=(m, 4, 4, 2)``: quarter i belongs to its node i.

        The quarters around a node are the piece of the disc that its force stands for.
        """
        corner = self.x[self.faces]
        after = (corner + np.roll(corner, -1, axis=1)) / 2
        before = np.roll(after, 1, axis=1)
        centre = np.broadcast_to(corner.mean(axis=1, keepdims=True), corner.shape)
        return np.stack([corner, after, centre, before], axis=2)

    def area(self) -> np.ndarray:
        """Area that belongs to each node, ``shape=(n,)``, mm^2."""
        if self.nodal_area is not None:
            return self.nodal_area
        x, y = np.moveaxis(self.quarters(), -1, 0)
        quarter = ((x * np.roll(y, -1, -1) - y * np.roll(x, -1, -1)).sum(-1)) / 2
        return np.bincount(self.faces.ravel(), quarter.ravel(), minlength=len(self.x))

    def inward(self) -> np.ndarray:
        """Nodes that slip towards the axis of the punch, ``shape=(n,)``."""
        return (self.status == SLIP) & ((self.slip_increment * self.x).sum(axis=1) < 0)

    def borders(self) -> np.ndarray:
        """Lines between quarters of different status, ``shape=(k, 2, 2)``."""
        differs = self.status[self.faces] != self.status[np.roll(self.faces, -1, axis=1)]
        return self.quarters()[differs][:, 1:3]

    def rim(self) -> np.ndarray:
        """The edge of the disc, which is convex, ``shape=(k, 2, 2)``."""
        return self.x[ConvexHull(self.x).simplices]

    def mean_pressure(self) -> float:
        """Normal reaction over the area of the disc, MPa; 1 where nothing touches."""
        return self.reaction[:, 2].sum() / self.area().sum() or 1.0


def at_nodes(punch, *values) -> list:
    """Global numbers of the contact nodes, ascending, and their values, on rank 0.  Collective."""
    numbers = punch.V.dofmap.index_map.local_to_global(punch.contact.nodes.astype(np.int32))
    parts = punch.comm.gather((numbers, *values))
    if parts is None:
        return [None] * (1 + len(values))
    columns = [np.concatenate(part) for part in zip(*parts, strict=True)]
    return [column[np.argsort(columns[0])] for column in columns]


def gather(punch) -> ContactMap | None:
    """The present state of ``punch.contact`` on rank 0; None on the others.  Collective."""
    contact, V = punch.contact, punch.V
    owned = punch.mesh.topology.index_map(2).size_local
    facets = punch.facet_tags.find(CONTACT)
    second = V.dofmap.dof_layout.num_dofs == 27
    position = V.tabulate_dof_coordinates()[:, :2]
    faces = []
    for facet in facets[facets < owned]:
        nodes = fem.locate_dofs_topological(V, 2, np.array([facet], dtype=np.int32), remote=False)
        middle = nodes[
            np.linalg.norm(position[nodes] - position[nodes].mean(axis=0), axis=1).argmin()
        ]
        ring = np.setdiff1d(nodes, middle) if second else nodes
        spoke = position[ring] - position[nodes].mean(axis=0)
        ring = ring[np.argsort(np.arctan2(spoke[:, 1], spoke[:, 0]))]
        faces += _four(V, ring, middle) if second else [ring]
    faces = V.dofmap.index_map.local_to_global(np.array(faces, dtype=np.int32).ravel())
    faces = punch.comm.gather(faces)
    values = [getattr(contact, name) for name in VALUES]
    node, *values = at_nodes(punch, contact.x[:, :2], *values, contact.area)
    if node is None:
        return None
    x, *values, area = values
    faces = np.searchsorted(node, np.concatenate(faces)).reshape(-1, 4)
    return ContactMap(x, faces, *values, area if second else None)


def _four(V, ring, middle) -> list:
    """A face of nine nodes as four of four: ``ring`` goes round, corners and middles of edges by turns."""
    x = V.tabulate_dof_coordinates()[ring, :2]
    between = (np.roll(x, 1, axis=0) + np.roll(x, -1, axis=0)) / 2
    off = np.linalg.norm(x - between, axis=1)  # middles of edges lie between their neighbours
    first = 0 if off[::2].sum() > off[1::2].sum() else 1
    return [[ring[k], ring[(k + 1) % 8], middle, ring[k - 1]] for k in range(first, 8, 2)]


def mirrored(part: ContactMap) -> ContactMap:
    """The whole disc of its quarter x, y > 0; nodes on the axes occur again with each part."""
    signs = [np.array(of) for of in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    faces = [
        (part.faces if sign.prod() > 0 else part.faces[:, ::-1]) + k * len(part.x)
        for k, sign in enumerate(signs)
    ]
    vectors = [
        np.concatenate([of * [*sign, 1.0][: of.shape[1]] for sign in signs])
        for of in (part.x, part.reaction, part.slip_increment)
    ]
    status, f, area = (np.tile(of, 4) for of in (part.status, part.load_function, part.area()))
    x, reaction, slip = vectors
    return ContactMap(x, np.concatenate(faces), reaction, slip, status, f, area)


def draw(maps, title, file, point) -> None:
    """Draw ``maps``, pairs of a title and a ContactMap, side by side into a file; ``point`` is where P is, mm.

    Above, the load function f with stick, slip and open zones and the slip of the last increment; below, pressure
    and tangential traction. Forces are divided by the area of their node; f and pressure also by the mean pressure,
    so that one scale serves loaded and unloaded punches.
    """
    with rc_context({"font.size": 14, "hatch.linewidth": 0.6}):
        figure = Figure(figsize=(4.6 * len(maps) + 1.2, 10.0), layout="constrained")
        axes = figure.subplots(2, len(maps), squeeze=False)
        spot = dict(boxstyle="circle,pad=0.15", facecolor="white")
        for (above, below), (name, disc) in zip(axes.T, maps, strict=True):
            zones = draw_zones(above, disc)
            pressure = draw_tractions(below, disc)
            above.set_title(name)
            above.text(*point[:2], "P", bbox=spot, ha="center", va="center", fontsize=12)
        scale = dict(shrink=0.8, aspect=25)
        label = "{} / mean pressure".format
        figure.colorbar(zones, ax=axes[0], label=label("load function $f$"), extend="min", **scale)
        figure.colorbar(pressure, ax=axes[1], label=label("pressure"), extend="max", **scale)
        figure.legend(**LEGEND)
        figure.suptitle(title)
        figure.savefig(file, dpi=150)


def draw_zones(axes, disc: ContactMap):
    """Map of f with zones and slip vectors; returns what a colour bar needs."""
    zone = np.where(disc.inward(), REVERSE, disc.status)[disc.faces.ravel()]
    f = disc.load_function / disc.area() / disc.mean_pressure()
    image = paint(axes, disc, f, zone == STICK, cmap=STICKING, clim=(-1.2, 0))
    for number in (SLIP, OPEN, REVERSE):
        quarters, width = disc.quarters().reshape(-1, 4, 2), 0 if number == OPEN else 0.6
        style = dict(linewidth=width, **ZONES[number])
        axes.add_collection(PolyCollection(quarters[zone == number], **style))
    axes.add_collection(LineCollection(disc.borders(), colors="black", linewidths=1.8))
    _arrows(axes, disc, 1e3 * disc.slip_increment, disc.status == SLIP, "slip {:g} µm")
    return image


def draw_tractions(axes, disc: ContactMap):
    """Pressure with the tangential tractions on it; returns what a colour bar needs."""
    traction = disc.reaction / disc.area()[:, None]
    image = paint(axes, disc, traction[:, 2] / disc.mean_pressure(), cmap="Greys", clim=(0, 2))
    _arrows(axes, disc, traction[:, :2], disc.status != OPEN, "traction {:g} MPa")
    return image


def paint(axes, disc, values, shown=slice(None), **colours):
    """The disc's edge, and its quarters that are ``shown`` in the colour of their node's value."""
    values, quarters = values[disc.faces.ravel()][shown], disc.quarters().reshape(-1, 4, 2)[shown]
    order = np.argsort(-values.round(9), kind="stable")  # edges overlap: alike on all sides
    image = PolyCollection(quarters[order], array=values[order], **colours)
    # without edges, or with pixels rounded, the background would shine through seams
    image.set(edgecolor="face", linewidth=0.6, snap=False)
    axes.add_collection(image)
    axes.add_collection(LineCollection(disc.rim(), colors="black", linewidths=0.8, zorder=1.5))
    size = 1.18 * np.abs(disc.x).max()
    axes.set(xlim=(-size, size), ylim=(-size, size), aspect="equal")
    axes.set_axis_off()
    return image


def _arrows(axes, disc, vectors, shown, label) -> None:
    """Vectors at nodes, the longest a sixth of the radius, with a key; fewer on fine meshes."""
    x, vectors, radius = disc.x[shown], vectors[shown], np.abs(disc.x).max()
    longest = np.linalg.norm(vectors, axis=1).max(initial=0.0)
    if longest == 0.0:
        return
    if len(disc.x) > 500:
        square = np.round(x / (0.09 * radius))  # of a lattice, keep the node nearest to its middle
        nearest = np.argsort(np.linalg.norm(x / (0.09 * radius) - square, axis=1).round(6))
        _, first = np.unique(square[nearest], axis=0, return_index=True)
        x, vectors = x[nearest[first]], vectors[nearest[first]]
    style = dict(angles="xy", scale_units="xy", scale=6 * longest / radius, width=4.5e-3)
    arrows = axes.quiver(*x.T, *vectors.T, **style)
    key = float(f"{longest:.1g}")
    text = dict(labelpos="N", labelsep=0.05, fontproperties=dict(size=12))
    axes.quiverkey(arrows, 0.87, 0.01, key, label.format(key), **text)
