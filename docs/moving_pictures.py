"""The punch as an animation of its stick and slip zones, and in space.  From the root of the clone:

python -m docs.moving_pictures            # results/study/cycle.gif, from a run of studies/punch
python -m docs.moving_pictures space      # results/study/space.png, from results/punch of `make punch`; needs PyVista
"""

import sys
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "results" / "study"


def cycle(case: str = "C", refine: int = 0) -> Path:
    """The second cycle in small increments, a frame each."""
    from studies.punch import Parameters, Punch, programme  # before DOLFINx, see its wheel

    # isort: split
    from matplotlib.animation import PillowWriter
    from matplotlib.figure import Figure

    from studies.punch.contact_map import LEGEND, draw_zones, gather

    parameters = Parameters(case=case, refine=refine, cycles=2, loading=12, unloading=24, tol=1e-8)
    punch, depths = Punch(parameters), programme(parameters)
    figure = Figure(figsize=(4.6, 5.0), dpi=100)
    figure.legend(**LEGEND | dict(loc="lower center", ncols=2, fontsize=9))
    axes = figure.add_axes((0.02, 0.13, 0.96, 0.8))
    writer, file = PillowWriter(fps=6), FOLDER / "cycle.gif"
    with writer.saving(figure, file, dpi=100):
        for number, depth in enumerate(depths):
            punch.press(depth)
            if number < len(depths) // 2:
                continue
            axes.clear()
            draw_zones(axes, gather(punch))
            figure.suptitle(f"case {case}, cycle 2: top {depth:.3f} mm down", fontsize=11)
            writer.grab_frame()
    return file


def space(source: Path = Path("results/punch/punch.pvd")) -> Path:
    """A loaded punch from below, cut open: von Mises stress; on the plane, stick and slip."""
    import numpy as np
    import pyvista

    reader = pyvista.get_reader(source)
    reader.set_active_time_value(7.0)  # unloading, when zones of all kinds are there
    (grid,) = reader.read()
    bricks = np.full(
        grid.n_cells, pyvista.CellType.HEXAHEDRON
    )  # of the same nodes, but not "Lagrange"
    plain = pyvista.UnstructuredGrid(grid.cells, bricks, grid.points)
    plain.point_data.update(grid.point_data)
    plain.cell_data.update(grid.cell_data)
    shown = plain.warp_by_vector("displacement", factor=20)
    body = shown.extract_cells(np.flatnonzero(plain.cell_centers().points[:, 1] > 0))
    foot = plain.extract_surface(algorithm=None)
    foot = foot.extract_cells(np.flatnonzero(np.abs(foot.cell_centers().points[:, 2]) < 1e-6))
    foot = foot.translate((0, 0, -7.0))
    plotter = pyvista.Plotter(off_screen=True, window_size=(1100, 800))
    bar = dict(vertical=True, fmt="%.0f", title_font_size=20, label_font_size=18, color="black")
    stress = bar | dict(title="von Mises stress [MPa]", position_x=0.86, position_y=0.3)
    plotter.add_mesh(body, scalars="von_Mises", cmap="viridis", show_edges=True, lighting=False, scalar_bar_args=stress)  # fmt: skip
    zones = ["white", "#4a90c4", "#f0a33a"]
    plotter.add_mesh(foot, scalars="status", cmap=zones, clim=(-0.5, 2.5), show_edges=True, lighting=False, show_scalar_bar=False)  # fmt: skip
    plotter.add_text("below, pulled down: the foot; blue sticks, orange slips", position="lower_left", font_size=11, color="black")  # fmt: skip
    plotter.camera_position = [(22, -46, 22), (0, 0, 1), (0, 0, 1)]
    file = FOLDER / "space.png"
    plotter.screenshot(file)
    return file


if __name__ == "__main__":
    print(space() if sys.argv[1:] == ["space"] else cycle())
