"""ParaView files of a punch: displacement, stress and the state of its contact nodes, per step."""

from __future__ import annotations

from dolfinx_contact.compat import functionspace, interpolation_points

# isort: split
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.io import VTKFile

COMPONENTS = "xx", "yy", "zz", "xy", "yz", "xz"


def von_mises(xx, yy, zz, xy, yz, xz):
    """The stress of uniaxial tension with the same shape-changing energy."""
    normal = ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2
    return np.sqrt(normal + 3 * (xy**2 + yz**2 + xz**2))


class FieldWriter:
    """Writes a collection ``punch.pvd`` into a directory, to be opened in ParaView.

    - per node: displacement [mm]; and of the contact nodes reaction [N] and slip increment [mm] in
      global components, gap [mm], load function f [N], status (0 open, 1 stick, 2 slip), pressure
      [MPa], nodal area [mm^2], work of friction so far [N mm]. Nodes that are no contact nodes have
      zeros, and status -1;
    - per cell: von Mises stress and the components of the stress [MPa], as scalars because
      DOLFINx 0.5 refuses tensors here.

    Args:
        punch: Whose fields to write.
        directory: Path of an existing directory.
    """

    def __init__(self, punch, directory):
        self.contact, self.u, V = punch.contact, punch.u, punch.V
        self.slip = fem.Function(V, name="slip_increment")

        six = functionspace(punch.mesh, ("DG", 0, (6,)))
        sigma = punch.stress(self.u)
        components = ufl.as_vector([sigma["xyz".index(i), "xyz".index(j)] for i, j in COMPONENTS])
        self.expression = fem.Expression(components, interpolation_points(six))
        self.stress = fem.Function(six)
        cellwise, parent = six.sub(0).collapse()
        self.cells = np.ravel(parent) // 6  # of each degree of freedom of the cell-wise scalars
        self.cellwise = {
            name: fem.Function(cellwise, name=name)
            for name in ["von_Mises", *("stress_" + component for component in COMPONENTS)]
        }
        self.path = directory / "punch.pvd"
        self._file = VTKFile(punch.comm, str(self.path), "w")

    def write(self, step: float) -> None:
        """Write the present state as time ``step``.  Collective."""
        contact = self.contact
        slip = self.slip.x.array.reshape(-1, 3)
        slip[contact.nodes] = contact.slip_increment @ contact.frame[:2]
        self.slip.x.scatter_forward()
        self.stress.interpolate(self.expression)
        stress = self.stress.x.array.reshape(-1, 6)[self.cells].T
        for function, values in zip(
            self.cellwise.values(), [von_mises(*stress), *stress], strict=True
        ):
            function.x.array[:] = values
        fields = [self.u, contact.reaction_function(), self.slip]
        fields += [
            contact.function(contact.gap, "gap"),
            contact.function(contact.load_function, "load_function"),
            contact.function(contact.status, "status", elsewhere=-1),
            contact.function(contact.pressure, "pressure"),
            contact.function(contact.area, "area"),
            contact.function(contact.dissipation, "dissipation"),
        ]
        fields += self.cellwise.values()
        self._file.write_function(fields, step)

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self._file.close()
