# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""``dc.plot`` and ``dc.profile``: what a picture shows, and values along a row of points."""

from ctypes.util import find_library

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import pytest
import scenes
from patches import CELLS, PRESSURE, pressed

from dolfinx_contact.results.meshes import BodyMesh, SurfaceMesh
from dolfinx_contact.results.plot import _seen

pytestmark = pytest.mark.ranks
COMM = scenes.COMM


@pytest.fixture
def folder(tmp_path):
    return COMM.bcast(tmp_path, root=0)


@pytest.fixture(scope="module")
def slid():
    """A block of which some nodes stick and others slip."""
    scene = scenes.block()
    for x in (0.0, 0.001):
        scene.move_top(x, 0, -0.01)
        scene.step = scene.problem.solve()
    assert scene.step.counts.stick and scene.step.counts.slip
    return scene


def test_a_picture_shows_zones(slid, folder):
    """The picture has pixels in the colours of sticking and of slipping nodes, none in that of open ones."""
    pytest.importorskip("pyvista")
    if find_library("EGL") is None:
        pytest.skip("VTK draws without a display by EGL")
    image = pytest.importorskip("matplotlib.image")
    dc.plot(slid.problem, folder / "a" / "b.png", colour=slid.u[2], title="height", factor=5)
    pixels = image.imread(folder / "a" / "b.png")[..., :3].reshape(-1, 3) * 255

    def count(colour: str) -> int:
        rgb = [int(colour[k : k + 2], 16) for k in (0, 2, 4)]
        return int((np.abs(pixels - rgb).max(axis=1) < 2).sum())

    assert count("2a6fbb") > 20 and count("f0a33a") > 20  # in the legend at least
    assert count("ffffff") < 0.95 * len(pixels)


def test_the_surface_is_drawn_where_it_stands(slid):
    """A plane that has moved by d is drawn f d from where it was, as the body is, so that gaps are enlarged as much."""
    contact, u = slid.contact, slid.u
    body, foot = BodyMesh(contact.displacements)(u, {}), SurfaceMesh(contact)(u)
    if COMM.rank == 0:
        for factor in (1.0, 10.0):
            contact.surface.displacement = (0, 0, 0.002)
            seen = _seen([contact], body, [foot], factor)
            contact.surface.displacement = (0, 0, 0)
            low, high, counts = seen["box0"]
            z = np.linspace(low[2], high[2], int(counts[2]))
            found = seen["distance0"].reshape(counts[::-1].astype(int))
            assert found == pytest.approx(
                (z - 0.002 * factor)[:, None, None] + 0 * found, abs=1e-12
            )
            assert len(seen["nodes"]) == 25


def test_mistakes_are_refused(slid, folder):
    """Another ending, a vector as colour, a factor that is not finite, points off the surface or of another shape, a contact that
    is not there, one in the place of the problem: a ValueError on all ranks that says so."""
    for options, said in (
        ({"path": "a.pdf"}, "must end in .png"),
        ({"colour": slid.u}, "must be a scalar"),
        ({"colour": "mises"}, "colour must be a Function or another UFL expression, got 'mises'"),
        ({"factor": np.nan}, "factor must be finite"),
    ):
        with pytest.raises(ValueError, match=said):
            dc.plot(slid.problem, **{"path": folder / "a.png"} | options)
    with pytest.raises(ValueError, match=r"\(2, 0, 0\) is 1.5 away .* nearest is \(0.5, 0, 0\)"):
        dc.profile(slid.problem, [[0, 0, 0], [2, 0, 0]])
    for call in (dc.History, lambda of: dc.plot(of, "a.png"), lambda of: dc.profile(of, [[0, 0, 0]]), lambda of: dc.advance(of, print, [1.0]), lambda of: dc.cycle_jump(of, print, 10)):  # fmt: skip
        with pytest.raises(ValueError, match="problem must be a ContactProblem, got <Contact of"):
            call(slid.contact)
    with pytest.raises(ValueError, match=r"shape \(k, 3\)"):
        dc.profile(slid.problem, [0, 0, 0])
    with pytest.raises(ValueError, match="contact 1"):
        dc.profile(slid.problem, [[0, 0, 0]], contact=1)


@pytest.mark.parametrize("cell", [cell for cell in CELLS if cell != "prism"])
@pytest.mark.parametrize("degree", [1, 2])
def test_a_profile_of_an_even_state(cell, degree, folder):
    """Along a line across the face of a turned, distorted block an even pressure is even and a linear displacement exact; the
    file has the table."""
    found = pressed(cell, degree, True, True)
    d, turn = found.mesh.geometry.dim, found.contact.frame
    at = np.full((40, d), 0.4)
    at[:, 0], at[:, -1] = np.linspace(0, 1, 40), 0.0
    points = at @ turn
    table = dc.profile(found.problem, points, folder / "line.csv")
    assert table["s"] == pytest.approx(at[:, 0], abs=1e-12)
    assert table["pressure"] == pytest.approx(PRESSURE, rel=1e-9)
    exact = found.moved(points.T).T
    for axis, column in zip("xyz", exact.T):
        assert table[f"displacement_{axis}"] == pytest.approx(
            column, abs=1e-9 * np.abs(exact).max()
        )
    assert (table["status"] == dc.Status.SLIP).all()
    read = np.genfromtxt(folder / "line.csv", delimiter=",", names=True)
    assert list(read.dtype.names) == list(table)
    assert read["shear_traction_x"] == pytest.approx(table["shear_traction_x"], rel=1e-9)


def test_a_profile_is_that_of_the_nodes(slid):
    """At contact nodes the table has what the contact has there."""
    x, pressure, status, gap = (
        np.concatenate(COMM.allgather(getattr(slid.contact, name)))
        for name in ("x", "pressure", "status", "gap")
    )
    table = dc.profile(slid.problem, x)
    assert table["pressure"] == pytest.approx(pressure, rel=1e-9)
    assert np.array_equal(table["status"], status)
    assert table["gap"] == pytest.approx(gap, abs=1e-14)
