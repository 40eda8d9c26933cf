# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Scenes of two deformable bodies: stiff on soft, gaps, overlaps, edges, slivers, tilted, of all cells and orders."""

from __future__ import annotations

import numpy as np

from benchmarks.stress.scenes import Family, Scene
from mechanics.scenes import rotation

ORTHOTROPIC = dict(mu=(0.3, 0.15), p=(0.05, 0.2))
TILTED = np.array([[0.8, -0.6], [0.6, 0.8]])
WAYS = {
    "press": [(0, 0, -0.005), (0, 0, -0.01), (0, 0, -0.003)],
    "stick": [(0, 0, -0.01), (0.0004, 0.0002, -0.01), (-0.0004, 0.0001, -0.011)],
    "shear": [(0, 0, -0.01), (0.002, 0.001, -0.01), (0.004, 0.002, -0.012), (-0.001, 0, -0.01)],
    "slide": [(0, 0, -0.01), (0.02, 0.01, -0.01), (0.045, 0.01, -0.01), (0.01, 0.02, -0.008)],
    "far": [(0, 0, -0.01), (0.25, 0, -0.01), (0.5, 0, -0.01), (0.3, 0, -0.01)],
    "lift": [(0, 0, -0.01), (0.002, 0, -0.01), (0.002, 0, 0.02), (0, 0, -0.006)],
}


class PairScene(Scene):
    """A scene whose ``body`` goes to ``build_two``."""

    @property
    def tops(self) -> list[tuple]:
        """Displacements of the head over the height of a block, step by step, scene's axes."""
        flat = len(self.body.get("cells", ((4, 2),))[0]) == 2
        return [np.array(way)[[0, 2] if flat else [0, 1, 2]] for way in WAYS[self.programme]]


def pair_scenes() -> list[PairScene]:
    """All of them, in an order that does not change."""
    found = Family(PairScene)

    def add(group, name, *programmes, **body):
        found.add(f"two bodies: {group}", name, *programmes, laws={"": {}}, **body)

    for swapped in (False, True):
        side, of = "lower" if swapped else "upper", dict(swapped=swapped)
        for k in (-4, -2, 2, 4):
            add("moduli", f"1e{k} {side}", "press", "shear", "slide", moduli=(10.0**k, 1.0), **of)
        for gap in (1e-9, 0.004, -1e-9, -0.004):
            add("gaps", f"{gap:g} {side}", "shear", gap=gap, **of)
        for k in (-4, 4):
            add("bars", f"1e{k} {side}", "press", moduli=(10.0**k, 1.0), nu=0.0, gap=0.001, **of)
        add("bars", f"overlap {side}", "press", nu=0.0, gap=-0.002, **of)
        for shift in (0.3, -0.55, 0.999):
            add("edges", f"shift {shift} {side}", "shear", "slide", shift=shift, **of)
        add("edges", f"small on large {side}", "far", size=(1.0, 2.0), cells=((4, 2), (9, 2)), **of)
        for k in (3, 6, 9, 12):
            add("slivers", f"1e-{k} {side}", "shear", cells=((4, 2), (4, 2)), shift=10.0**-k, **of)
        for squeezed in (0.1, 0.01):
            add("slivers", f"cells {squeezed} {side}", "stick", squeezed=squeezed, **of)
        for cells in (((4, 2), (4, 2)), ((1, 1), (7, 2)), ((9, 3), (2, 1)), ((12, 2), (13, 2))):
            add("meshes", f"{cells[0][0]} on {cells[1][0]} {side}", "lift", cells=cells, **of)
        for length, E in ((1e-3, 210e9), (1e3, 210e3), (1.0, 1e-6), (1e-9, 1e15)):
            add("units", f"length {length:g} E {E:g} {side}", "shear", length=length, E=E, **of)
        for sliding in ("small", "large"):
            of |= dict(sliding=sliding)
            for cell in ("triangle", "quadrilateral"):
                for degree in (1, 2):
                    name = f"{cell} {degree} {sliding} {side}"
                    add(
                        "tilted",
                        name,
                        "shear",
                        "slide",
                        cell=cell,
                        degree=degree,
                        turn=TILTED,
                        **of,
                    )
            add("round", f"{sliding} {side}", "press", "shear", "slide", radius=5.0, cells=((10, 3), (13, 3)), size=(1.0, 1.2), moduli=(1.0, 3.0), **of)  # fmt: skip
            for cell, degree in (("hexahedron", 1), ("tetrahedron", 1), ("hexahedron", 2), ("tetrahedron", 2)):  # fmt: skip
                name, few = f"{cell} {degree} {sliding} {side}", ((2, 2, 1), (3, 3, 1))
                add("space", name, "slide", cell=cell, degree=degree, cells=few, turn=rotation(2), **ORTHOTROPIC, **of)  # fmt: skip
        for mu in (0.0, 1e-4, 1.0, 10.0):
            add("isotropic mu", f"mu {mu:g} {side}", "shear", "slide", mu=mu, swapped=swapped)
    return found
