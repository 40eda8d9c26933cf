# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The drawings of docs/theory: friction cone, slip rule, projection, common parts of facets with dual shape functions.  From the root: python -m docs.drawings

Curves are computed with the package itself; vector graphics, readable on light and dark ground.
"""

import re
from pathlib import Path

import dolfinx_contact as dc
from dolfinx_contact import _kernel

# isort: split
import matplotlib
import numpy as np

matplotlib.use("svg")
from matplotlib import pyplot as plt

FOLDER = Path(__file__).parent / "theory"
INK, CONE, SLIP, FORCE = "#777777", "#2a78d6", "#e8710a", "#1a9850"
MU, P = np.array([0.30, 0.15]), np.array([0.05, 0.20])
SETTINGS = {"svg.hashsalt": "dolfinx_contact", "font.size": 10}
ANGLE = np.linspace(0, 2 * np.pi, 400)


def save(figure, name: str) -> None:
    figure.savefig(FOLDER / name, transparent=True, metadata={"Date": None})
    plt.close(figure)
    text = (FOLDER / name).read_text()  # a hundredth of a point is seen by nobody
    text = re.sub(r"\b([1-9]\d*\.\d\d)\d+", r"\1", text)
    (FOLDER / name).write_text(re.sub(r"\n +", "\n", text))


def axes_through_zero(axes, x: str, y: str) -> None:
    for side in ("left", "bottom"):
        axes.spines[side].set(position="zero", color=INK)
    for side in ("right", "top"):
        axes.spines[side].set_visible(False)
    axes.set(xticks=[], yticks=[], aspect="equal")
    axes.annotate(x, (1, 0), xycoords=axes.get_yaxis_transform(which="grid"), color=INK)
    axes.annotate(y, (0, 1), xycoords=axes.get_xaxis_transform(which="grid"), color=INK)


def arrow(axes, start, end, colour: str, text: str, offset=(4, 4), **style) -> None:
    drawn = dict(arrowstyle="-|>", color=colour, lw=1.8, shrinkA=0, shrinkB=0) | style
    axes.annotate("", end, start, arrowprops=drawn)
    axes.annotate(text, end, offset, textcoords="offset points", color=colour)


def cone() -> None:
    """The cone in space, with a section and one force on it."""
    figure = plt.figure(figsize=(5.2, 4.2))
    axes = figure.add_axes((0, 0, 1, 1), projection="3d", computed_zorder=False)
    axes.set_axis_off()
    for height in (0.4, 0.7, 1.0):
        ellipse = height * MU[:, None] * [np.cos(ANGLE), np.sin(ANGLE)]
        axes.plot(*ellipse, height, color=CONE, lw=1.6 if height == 1 else 0.8)
    for angle in np.linspace(0, 2 * np.pi, 25)[:-1]:
        edge = MU * [np.cos(angle), np.sin(angle)]
        axes.plot([0, edge[0]], [0, edge[1]], [0, 1], color=CONE, lw=0.5)
    for end, name in (((0.45, 0, 0), "$r_x$"), ((0, 0.4, 0), "$r_y$"), ((0, 0, 1.15), "$r_n$")):
        axes.plot(*zip((0, 0, 0), end), color=INK, lw=1)
        axes.text(*(1.06 * np.array(end)), name, color=INK)
    force = 0.7 * np.array([MU[0] * np.cos(2.2), MU[1] * np.sin(2.2), 1])
    axes.plot(*zip((0, 0, 0), force), color=FORCE, lw=2.2)
    axes.text(*(force * [1.5, 1, 1.03]), "$r$: slip", color=FORCE)
    axes.plot(*zip((0, 0, 0), (0.05, -0.02, 0.8)), color=SLIP, lw=2.2)
    axes.text(0.05, -0.02, 0.83, "$r$: stick", color=SLIP)
    axes.plot([0, MU[0]], [0, 0], [1, 1], color=INK, lw=0.8, ls="--")
    axes.text(MU[0] + 0.02, 0, 1.0, r"$\mu_x r_n$", color=INK)
    axes.set(xlim=(-0.32, 0.32), ylim=(-0.32, 0.32), zlim=(0, 1.1))
    axes.set_box_aspect((1, 1, 1.4), zoom=0.95)
    axes.view_init(18, -58)
    save(figure, "cone.svg")


def slip_rule() -> None:
    """Sections of the cone with slip at some forces: associated, and with p of its own."""
    figure, both = plt.subplots(1, 2, figsize=(8.4, 3.0), layout="constrained")
    for axes, p, title in zip(both, (MU, P), ("associated: p = µ", "p = (0.05, 0.20)")):
        axes.plot(*(MU[:, None] * [np.cos(ANGLE), np.sin(ANGLE)]), color=CONE)
        inner = p / (p / MU).max()
        axes.plot(*(inner[:, None] * [np.cos(ANGLE), np.sin(ANGLE)]), color=CONE, lw=0.8, ls=":")
        friction = dc.Friction(mu=tuple(MU), p=tuple(p))
        for angle in np.radians([20, 55, 125, 200, 260, 320]):
            force = MU * [np.cos(angle), np.sin(angle)]
            against = friction.against_slip(force[None])[0]
            arrow(axes, (0, 0), force, FORCE, "", lw=1.0)
            arrow(axes, force, force + 0.1 * against, SLIP, "")
        axes.set(xlim=(-0.44, 0.44), ylim=(-0.38, 0.3))
        axes_through_zero(axes, "$r_x$", "$r_y$")
        axes.set_title(title, color=INK, fontsize="medium", y=-0.06)
    save(figure, "slip_rule.svg")


def projection() -> None:
    """In the plane of one tangent and the normal: the three regions, a predictor and its projection."""
    figure, axes = plt.subplots(figsize=(5.6, 3.6), layout="constrained")
    mu = 0.5
    axes.fill([0, -mu, mu], [0, 1, 1], color=CONE, alpha=0.18, lw=0)
    axes.fill([0, -0.5 / mu, 0.5 / mu], [0, -0.5, -0.5], color=INK, alpha=0.15, lw=0)
    axes.plot([-mu, 0, mu], [1, 0, 1], color=CONE)
    axes.plot([-0.5 / mu, 0, 0.5 / mu], [-0.5, 0, -0.5], color=INK, lw=1)
    predictor = np.array([[0.80, 0.0, 0.45]])
    found = dc.law.project_cone(predictor, mu)[0]
    start, end = predictor[0, [0, 2]], found[[0, 2]]
    arrow(axes, start, end, FORCE, "")
    axes.plot(*start, "o", color=SLIP)
    axes.plot(*end, "o", color=FORCE)
    axes.annotate("predictor τ", start, (6, -4), textcoords="offset points", color=SLIP)
    axes.annotate("new force r", end, (-8, 10), textcoords="offset points", color=FORCE, ha="right")
    for text, at in (
        ("inside: sticks", (0, 0.93)),
        ("polar cone: opens", (0, -0.42)),
        ("slips", (0.78, 0.12)),
    ):
        axes.text(*at, text, color=INK, ha="center")
    axes.set(xlim=(-1.05, 1.25), ylim=(-0.52, 1.05))
    axes_through_zero(axes, "$r_t$", "$r_n$")
    save(figure, "projection.svg")


def mortar() -> None:
    """Common parts of a facet and those opposite; shape functions of two elements and their duals."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.4, 3.2), layout="constrained")
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    turn = np.radians(17)
    axes = 0.62 * np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    corner = np.array([0.42, -0.02])
    for i in (-1, 0):
        for j in (-1, 0, 1):
            facet = (square + [i, j]) @ axes + corner
            corners, count = _kernel.clip(square[None], facet[None])
            part = corners[0, : count[0]]
            left.fill(*facet.T, fill=False, edgecolor=SLIP, lw=0.7)
            if len(part) > 2:
                left.fill(*part.T, color=CONE, alpha=0.12 + 0.1 * ((i + 2 * j) % 4), lw=0)
                left.plot(*part.mean(axis=0), ".", color=INK, ms=4)
    left.fill(*square.T, fill=False, edgecolor=CONE, lw=2.2)
    left.text(0.02, 1.04, "slave facet", color=CONE)
    left.text(1.06, 0.5, "facets\nopposite", color=SLIP)
    left.set(xlim=(-0.35, 1.55), ylim=(-0.3, 1.25), aspect="equal")
    left.set_axis_off()
    at = np.array([0.0, 1.0])
    hats = np.stack((1 - at, at))
    M = np.array([[2, 1], [1, 2]]) / 6
    dual = np.diag(M.sum(axis=1)) @ np.linalg.inv(M) @ hats
    for start, node in ((0, 1), (1, 0)):
        for of, colour, style in ((hats[node], CONE, "--"), (dual[node], FORCE, "-")):
            right.plot(at + start, of, style, color=colour)
    right.plot([0, 1, 2], [0, 0, 0], "o", color=INK, ms=5, clip_on=False)
    right.text(1.34, 1.1, r"$\psi_a$", color=FORCE)
    right.text(1.52, 0.52, "$N_a$", color=CONE)
    right.text(1.0, -0.32, "$a$", color=INK, ha="center")
    right.set(xlim=(-0.05, 2.05), ylim=(-1.15, 2.2), xticks=[], yticks=[-1, 0, 1, 2])
    right.spines["bottom"].set(position="zero", color=INK)
    right.spines["left"].set(color=INK)
    right.tick_params(colors=INK)
    for side in ("right", "top"):
        right.spines[side].set_visible(False)
    save(figure, "mortar.svg")


if __name__ == "__main__":
    plt.rcParams |= SETTINGS
    for draw in (cone, slip_rule, projection, mortar):
        draw()
