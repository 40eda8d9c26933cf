# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The drawings of docs/theory/algorithms.md.  From the root: python -m docs.drawings_algorithms

Vector graphics, readable on light and dark ground.
"""

import matplotlib
import numpy as np

matplotlib.use("svg")
from matplotlib import pyplot as plt

from docs.drawings import CONE, FORCE, INK, SETTINGS, SLIP, arrow, save

COLUMNS, ROWS = 7, 4  # nodes of the body that is drawn


def body(axes, origin=(0.0, 0.0), width: float = 1.0) -> np.ndarray:
    """A mesh of squares; its nodes, the lowest row first."""
    x, y = np.meshgrid(np.linspace(0, width, COLUMNS), np.linspace(0, 0.5 * width, ROWS))
    x, y = x + origin[0], y + origin[1]
    axes.plot(x, y, color=INK, lw=0.7)
    axes.plot(x.T, y.T, color=INK, lw=0.7)
    return np.stack([x.ravel(), y.ravel()], axis=1)


def springs(axes, nodes: np.ndarray, length: float = 0.12) -> None:
    along = np.linspace(0, 1, 9)
    aside = 0.018 * np.array([0, 0, 1, -1, 1, -1, 1, 0, 0])
    for x, y in nodes:
        axes.plot(x + aside, y - length * along, color=SLIP, lw=1.2)


def plane(axes, start: float, end: float, height: float) -> None:
    axes.plot([start, end], [height, height], color=INK, lw=2)


def blank(axes, x, y) -> None:
    axes.set(xlim=x, ylim=y, aspect="equal")
    axes.set_axis_off()


def fixed_point() -> None:
    """One iteration as a ring of three stations."""
    figure, axes = plt.subplots(figsize=(6.4, 2.8), layout="constrained")
    body(axes, (0, 0.25), 1.2)
    plane(axes, -0.1, 1.3, 0.2)
    axes.text(0.6, 0.95, "body: $(K + S)\\,\\delta u = f - Ku + r$", color=INK, ha="center")
    corner = np.array([2.6, 0.25])
    axes.fill(*(corner + [[0, 0], [-0.4, 0.65], [0.4, 0.65]]).T, color=CONE, alpha=0.18, lw=0)
    axes.plot(*(corner + [[-0.4, 0.65], [0, 0], [0.4, 0.65]]).T, color=CONE)
    start, end = corner + [0.52, 0.36], corner + [0.29, 0.471]
    arrow(axes, start, end, FORCE, "")
    axes.plot(*start, "o", color=SLIP)
    axes.plot(*end, "o", color=FORCE)
    axes.text(2.6, 0.95, "each node: predictor, projection", color=INK, ha="center")
    arrow(axes, (1.4, 0.62), (2.05, 0.62), INK, "")
    axes.text(1.72, 0.69, "gaps, slip,\nreactions", color=INK, ha="center", va="bottom", fontsize=9)
    arrow(axes, (2.05, 0.36), (1.4, 0.36), FORCE, "")
    axes.text(1.72, 0.30, "new reactions $r$", color=FORCE, ha="center", va="top", fontsize=9)
    blank(axes, (-0.15, 3.4), (0.05, 1.1))
    save(figure, "fixed_point.svg")


def anderson() -> None:
    """Sizes of the corrections of x <- x + b - A x, plain and mixed, on a small linear problem."""
    eigenvalues = np.linspace(0.03, 1.0, 40)
    memory, steps = 12, 60

    def errors(kept: int) -> list[float]:
        x, states, corrections, found = np.ones(40), [], [], []
        for _ in range(steps):
            correction = -eigenvalues * x  # the solution is zero
            states, corrections = [*states, x][-kept - 1 :], [*corrections, correction][-kept - 1 :]
            found.append(float(np.linalg.norm(correction)))
            x = x + correction
            if len(states) > 1:
                dx, df = np.diff(states, axis=0).T, np.diff(corrections, axis=0).T
                x = x - (dx + df) @ np.linalg.lstsq(df, correction, rcond=None)[0]
        return found

    figure, axes = plt.subplots(figsize=(5.4, 3.0), layout="constrained")
    for kept, colour, text, aside in (
        (0, INK, "plain", (-6, 8)),
        (memory, CONE, "Anderson, 12 kept", (-70, 4)),
    ):
        history = np.array(errors(kept))
        history = history[history > 1e-12 * history[0]]
        axes.semilogy(history / history[0], color=colour, lw=1.8)
        axes.annotate(text, (len(history) - 1, history[-1] / history[0]), aside, ha="right",
                      textcoords="offset points", color=colour)  # fmt: skip
    for side in ("right", "top"):
        axes.spines[side].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(INK)
    axes.tick_params(colors=INK, which="both")
    axes.set_xlabel("iterations", color=INK)
    axes.set_ylabel("correction / first correction", color=INK)
    save(figure, "anderson.svg")


def condensed() -> None:
    """A body with its contact nodes; a dense matrix between them."""
    figure, axes = plt.subplots(figsize=(6.4, 2.6), layout="constrained")
    nodes = body(axes, (0, 0.2), 1.4)
    plane(axes, -0.1, 1.5, 0.16)
    axes.plot(*nodes[:COLUMNS].T, "o", color=SLIP)
    axes.text(0.7, 1.0, "$K$: all unknowns, sparse", color=INK, ha="center")
    arrow(axes, (1.65, 0.52), (2.2, 0.52), INK, "")
    axes.text(1.92, 0.58, "one solve\na column", color=INK, ha="center", va="bottom", fontsize=9)
    for row in range(COLUMNS):
        for column in range(COLUMNS):
            near = 0.25 + 0.75 / (1 + abs(row - column))
            corner = (2.4 + 0.1 * column, 0.85 - 0.1 * row)
            axes.add_patch(plt.Rectangle(corner, 0.085, -0.085, color=SLIP, alpha=near, lw=0))
    axes.text(2.75, 1.0, "$W$: contact nodes, dense", color=INK, ha="center")
    blank(axes, (-0.15, 3.5), (0.08, 1.12))
    save(figure, "condensed.svg")


def sparse_newton() -> None:
    """The pattern of the tangent; rows of contact nodes are replaced."""
    figure, both = plt.subplots(1, 2, figsize=(6.4, 3.0), layout="constrained")
    axes = both[0]
    nodes = body(axes, (0, 0), 1.0)
    plane(axes, -0.05, 1.05, -0.03)
    axes.plot(*nodes[COLUMNS:].T, "o", color=CONE, ms=5)
    axes.plot(*nodes[:COLUMNS].T, "o", color=SLIP, ms=5)
    blank(axes, (-0.1, 1.1), (-0.2, 0.7))
    size = COLUMNS * ROWS
    row, column = np.divmod(np.arange(size), COLUMNS)
    linked = (abs(row[:, None] - row) <= 1) & (abs(column[:, None] - column) <= 1)
    contact = np.arange(size) < COLUMNS
    axes = both[1]
    for rows, colour in ((~contact, CONE), (contact, SLIP)):
        i, j = np.nonzero(linked & rows[:, None])
        axes.scatter(j, i, s=9, marker="s", color=colour, lw=0)
    blank(axes, (-1, size), (size, -1))
    save(figure, "sparse_newton.svg")


def multigrid() -> None:
    """Three levels of a body on springs, one cycle down and up."""
    figure, axes = plt.subplots(figsize=(6.4, 2.0), layout="constrained")
    texts = ("$K + S$", "$P^TKP + P^TSP$", "the coarsest: solved")
    for level, (across, up) in enumerate(((9, 5), (5, 3), (3, 2))):
        x, y = np.meshgrid(np.linspace(0, 1, across), np.linspace(0, 0.5, up))
        x = x + 1.45 * level
        axes.plot(x, y, color=INK, lw=0.7)
        axes.plot(x.T, y.T, color=INK, lw=0.7)
        axes.plot(x, y, "o", color=CONE, ms=3 + level)
        springs(axes, np.stack([x[0], y[0]], axis=1))
        plane(axes, 1.45 * level - 0.06, 1.45 * level + 1.06, -0.13)
        axes.text(1.45 * level + 0.5, -0.27, texts[level], color=INK, ha="center")
    for left in (1.1, 2.55):
        arrow(axes, (left, 0.36), (left + 0.26, 0.36), INK, "")
        arrow(axes, (left + 0.26, 0.14), (left, 0.14), FORCE, "")
    axes.text(1.225, 0.6, "forces out of balance go down", color=INK, ha="center", fontsize=9)
    axes.text(2.675, 0.6, "corrections come back", color=FORCE, ha="center", fontsize=9)
    blank(axes, (-0.1, 4.05), (-0.35, 0.75))
    save(figure, "multigrid.svg")


def surface_layer() -> None:
    """The two layers of nodes next to the plane, then the whole body."""
    figure, axes = plt.subplots(figsize=(6.4, 2.5), layout="constrained")
    for left, chosen in ((0.0, 2 * COLUMNS), (2.0, ROWS * COLUMNS)):
        nodes = body(axes, (left, 0.2), 1.4)
        plane(axes, left - 0.1, left + 1.5, 0.15)
        axes.plot(*nodes[:chosen].T, "o", color=SLIP if left == 0 else CONE, ms=5)
    axes.text(0.7, 1.0, "first: two layers, with the contact", color=SLIP, ha="center")
    axes.text(2.7, 1.0, "then: the whole body, with springs", color=CONE, ha="center")
    arrow(axes, (1.55, 0.55), (1.88, 0.55), INK, "")
    blank(axes, (-0.15, 3.55), (0.1, 1.15))
    save(figure, "surface_layer.svg")


def semismooth() -> None:
    """Newton's method on a function with a kink: from its own side each tangent leads nearer."""
    figure, axes = plt.subplots(figsize=(5.4, 2.8), layout="constrained")

    def value(x: float) -> float:
        return 2.2 * x - 0.4 if x > 0 else 0.5 * x - 0.4 - 0.12 * x**2

    def slope(x: float) -> float:
        return 2.2 if x > 0 else 0.5 - 0.24 * x

    along = np.linspace(-2.2, 0.75, 300)
    axes.plot(along, [value(x) for x in along], color=CONE, lw=1.8)
    axes.axhline(0, color=INK, lw=0.8)
    axes.plot(0, value(0), "o", color=SLIP, ms=6)
    axes.annotate("kink: the node changes its state", (0, value(0)), (-10, -20), ha="left",
                  textcoords="offset points", color=SLIP)  # fmt: skip
    x = -1.8
    for number in range(3):
        following = x - value(x) / slope(x)
        axes.plot([x, x], [0, value(x)], color=INK, ls=":", lw=1)
        axes.plot([x, following], [value(x), 0], color=FORCE, lw=1.2)
        axes.text(x, 0.08, f"$x_{number}$", color=INK, ha="center")
        x = following
    axes.set(ylim=(-1.9, 1.4))
    axes.set_axis_off()
    save(figure, "semismooth.svg")


def fallbacks() -> None:
    """Ways to a solution, each in the plane of two unknowns."""
    figure, three = plt.subplots(1, 3, figsize=(6.4, 2.3), layout="constrained")
    for axes, name in zip(three, ("interior point", "proximal points", "homotopy")):
        axes.set_title(name, color=INK, fontsize=10)
        axes.plot(1, 0.5, "*", color=FORCE, ms=11, zorder=3)
        blank(axes, (-0.15, 1.25), (-0.15, 1.25))
    way = np.linspace(0, 1, 9)
    inside, proximal, path = three
    inside.fill([0, 1, 1.1, 0], [0, 0.5, 1.2, 1.2], color=CONE, alpha=0.18, lw=0)
    inside.plot([0, 1.2], [0, 0.6], color=CONE)
    inside.plot(0.25 + 0.75 * way, 1.0 - 0.5 * way**2.5, ".-", color=SLIP)
    path.plot(way, 0.1 + 0.9 * way - 0.5 * way**2, ".-", color=SLIP)
    path.text(0.02, -0.1, "easier problem", color=INK, fontsize=9)
    a, b = np.array([[1.0, 0.75], [0.75, 1.0]]), np.array([1.375, 1.25])  # solved by (1, 0.5)
    x, centres = np.array([0.0, 1.1]), [np.array([0.0, 1.1])]
    for _ in range(7):
        x = np.linalg.solve(a + 0.35 * np.eye(2), b + 0.35 * x)
        centres.append(x)
    for centre in centres[:4]:
        proximal.add_patch(plt.Circle(centre, 0.12, fill=False, color=INK, ls=":"))
    proximal.plot(*np.array(centres).T, ".-", color=SLIP)
    save(figure, "fallbacks.svg")


if __name__ == "__main__":
    plt.rcParams |= SETTINGS
    for draw in (
        fixed_point,
        anderson,
        surface_layer,
        semismooth,
        condensed,
        sparse_newton,
        multigrid,
        fallbacks,
    ):
        draw()
