# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Script that draws the data gathered by ``plot.py``:  python draw.py SEEN.npz PICTURE.png TITLE

It runs in a separate process and needs only NumPy and PyVista.
"""

import sys
from typing import Any

import numpy as np
import pyvista

# Name and colour of each contact status, by its number.
STATUS_COLOURS = {0: ("open", "#8c8c8c"), 1: ("stick", "#2a6fbb"), 2: ("slip", "#f0a33a")}

# Size of the dot at a contact node, pixels: DOT_PIXELS divided by the square root of the number of
# nodes, within the limits below, so that dots are visible but do not overlap much.
DOT_PIXELS = 150.0
SMALLEST_DOT = 4.0
LARGEST_DOT = 12.0

# Fraction of the width and height of the picture that a two-dimensional body fills at most.  The
# rest is for legend and colour bar.
BODY_FRACTION = 0.75


def body_grid(seen: Any) -> pyvista.UnstructuredGrid:
    """Return the displaced mesh of the body as a PyVista grid."""
    kinds = {name: int(name[5:]) for name in seen if name.startswith("cells")}
    rows = [np.insert(seen[name], 0, seen[name].shape[1], axis=1).ravel() for name in kinds]
    types = [np.full(len(seen[name]), kind, dtype=np.uint8) for name, kind in kinds.items()]
    return pyvista.UnstructuredGrid(np.concatenate(rows), np.concatenate(types), seen["x"])


def zero_contour(box: np.ndarray, distance: np.ndarray) -> pyvista.PolyData:
    """Return a rigid surface: the zero level set of the distance.

    Args:
        box: Lowest corner, highest corner and number of points per direction of the grid,
            ``shape=(3, 3)``.
        distance: Distance at each grid point, with x varying fastest.
    """
    low, high, counts = box
    spacing = (high - low) / np.maximum(counts - 1, 1)
    spacing[spacing == 0.0] = 1.0
    grid = pyvista.ImageData(dimensions=counts.astype(int), spacing=spacing, origin=low)
    grid.point_data["distance"] = distance
    return grid.contour([0.0], scalars="distance")


def draw(seen: Any, picture: str, title: str) -> None:
    plotter = pyvista.Plotter(off_screen=True, window_size=(1100, 750))
    grid = body_grid(seen)
    bar = {"title": f"{title}\n", "vertical": True, "fmt": "%.3g", "color": "black"}
    bar |= {"position_x": 0.86, "position_y": 0.3, "title_font_size": 18, "label_font_size": 15}
    style = {"color": "#d8d8d8"}
    if "colour" in seen:
        style = {"scalars": seen["colour"], "lighting": False, "scalar_bar_args": bar}
    if "between" in seen:
        style["opacity"] = 0.3
    plotter.add_mesh(grid, show_edges=True, edge_opacity=0.25, **style)
    size = float(np.clip(DOT_PIXELS / np.sqrt(len(seen["nodes"])), SMALLEST_DOT, LARGEST_DOT))
    for status, (name, colour) in STATUS_COLOURS.items():
        nodes = seen["nodes"][seen["status"] == status]
        if len(nodes):
            balls = {"point_size": size, "render_points_as_spheres": True, "lighting": False}
            plotter.add_mesh(
                pyvista.PolyData(nodes), color=colour, label=f"{name}, {len(nodes)}", **balls
            )
    for name in seen:
        if name.startswith("box"):
            found = zero_contour(seen[name], seen[f"distance{name[3:]}"])
            if found.n_points:
                plotter.add_mesh(found, color="#9aa5b1", opacity=0.35, line_width=3)
    plotter.add_legend(bcolor=None, size=(0.15, 0.1), face="circle", loc="upper left")
    set_camera(plotter, grid, seen["view"])
    plotter.screenshot(picture)


def set_camera(plotter: Any, grid: Any, up: np.ndarray) -> None:
    """Set the camera position.

    A two-dimensional body is viewed from the front.  A three-dimensional body is viewed from below
    and beside the contact.

    Args:
        plotter: PyVista's plotter.
        grid: Mesh of the body.
        up: Mean normal of the contact surface, global frame; empty in two dimensions.
    """
    if not up.size:
        plotter.view_xy()
        plotter.enable_parallel_projection()
        low, high = np.reshape(plotter.bounds, (3, 2)).T
        width, height = plotter.window_size
        wide, high = (high - low)[:2]
        plotter.camera.parallel_scale = 0.5 * max(high, wide * height / width) / BODY_FRACTION
        return
    up = up / np.linalg.norm(up)
    aside = np.eye(3)[np.abs(up).argmin()]
    aside = np.cross(up, np.cross(aside, up))
    direction = -0.5 * up + aside / np.linalg.norm(aside) - 0.6 * np.cross(up, aside)
    centre = np.array(grid.center)
    plotter.camera_position = [centre + grid.length * direction, centre, up]
    plotter.reset_camera()
    plotter.camera.zoom(1.3)


if __name__ == "__main__":
    with np.load(sys.argv[1]) as file:
        draw(dict(file), *sys.argv[2:])
