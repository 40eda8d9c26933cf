# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Scenes of rigs: planes, balls and rollers that force drives, platens that tilt, nearly sliding and nearly tipping."""

from __future__ import annotations

from itertools import product

from benchmarks.stress.scenes import Family, Scene
from mechanics.corners import Push
from mechanics.rigs import Load

KS = range(1, 7)
RIGS = {
    "shear": [Load(), Load(shear=0.5), Load(shear=-0.5), Load(3.0, 0.5), Load(0.1, 0.2)],
    "stroke": [Load(), Load(stroke=1e-3), Load(2.0, stroke=1e-3), Load(stroke=-1e-3), Load(0.1)],
    "rocking": [Load(), Load(at=(0.1, 0.05)), Load(at=(0.3, 0.1)), Load(at=(-0.3, 0.0)), Load(2.0), Load(0.1)],
    **{f"nearly sliding, 1e-{k}": [Load(), Load(shear=1 - 10.0**-k), Load(shear=10.0**-k - 1)] for k in KS},
    **{f"nearly tipping, 1e-{k}":
       [Load(), Load(at=(0.5 - 10.0**-k, 0)), Load(at=(0, 10.0**-k - 0.5)), Load(at=(-0.3, 0.3))] for k in KS},
}  # fmt: skip


PUSHES = {
    "dragged": [Push(), Push(across=0.3), Push(across=-0.3, down=1.2, along=0.2), Push(turn=0.3, down=0.8), Push(down=-0.2),
                Push(across=0.1, down=0.5)],
}  # fmt: skip


class CornerScene(Scene):
    """A scene whose ``body`` goes to ``build_corner``."""

    @property
    def tops(self) -> list[Push]:
        """The displacements, step by step."""
        return PUSHES[self.programme][: self.most_steps]


def corner_scenes() -> list[CornerScene]:
    """Grooves of 1 to 170 degrees, whose edge belongs to two contacts."""
    found = Family(CornerScene)
    for angle in (1, 3, 10, 30, 60, 90, 120, 150, 170):
        found.add("corners", f"{angle} degrees", "dragged", angle=angle, cells=(4, 4, 2))
    return found


class RigScene(Scene):
    """A scene whose ``body`` goes to ``build_rig``."""

    @property
    def tops(self) -> list[Load]:
        """The loads, step by step."""
        return RIGS[self.programme][: self.most_steps]


def rig_scenes() -> list[RigScene]:
    """All of them, in an order that does not change."""
    found = Family(RigScene)
    add, tilting = found.add, dict(free=("n", "r1", "r2"))
    for k in range(-6, 4):
        add("weights", f"weight 1e{k}", "shear", weight=10.0**k)
    for k in KS:
        add("nearly sliding", "plane", f"nearly sliding, 1e-{k}")
        add("nearly tipping", "platen", f"nearly tipping, 1e-{k}", weight=1e-3, **tilting)
    for k in range(-6, 1):
        add("tilting platens", f"weight 1e{k}", "rocking", weight=10.0**k, **tilting)
    for k, kind in product((-1, 0, 1, 2, 3, 4, 6), ("ball", "roller")):
        group, of = f"{kind}s", dict(kind=kind, radius=10.0**k)
        for weight in (1e-3, 1.0):
            add(
                group, f"R/h 1e{k} weight {weight:g}", "shear", free=("x", "z"), weight=weight, **of
            )
        if k > 0:
            add(group, f"R/h 1e{k} beside", "stroke", free=("z",), offset=(0.03, 0.02), **of)
    return found
