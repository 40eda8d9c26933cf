"""ParaView files of a punch: displacement, stress and the state of its contact nodes, per step."""

from dolfinx_contact.compat import functionspace, interpolation_points

# isort: split
import ufl
from dolfinx import fem
from dolfinx.io import VTKFile


class FieldWriter:
    """Writes a collection ``punch.pvd`` into a directory, to be opened in ParaView.

    - per node: displacement [mm]; and of the contact nodes reaction [N] and slip increment [mm] in
      global components, gap [mm], load function f [N], status (0 open, 1 stick, 2 slip), pressure
      [MPa], nodal area [mm^2], work of friction so far [N mm]. Nodes that are no contact nodes have
      zeros, and status -1;
    - per cell: von Mises stress and the components of the stress [MPa], as scalars because
      DOLFINx 0.5 refuses tensors here.
    """

    def __init__(self, punch, directory):
        self.contact, self.u = punch.contact, punch.u
        self.slip = fem.Function(punch.V, name="slip_increment")
        cellwise, sigma = functionspace(punch.mesh, ("DG", 0)), punch.stress(self.u)
        deviator = ufl.dev(sigma)
        scalars = {"von_Mises": ufl.sqrt(1.5 * ufl.inner(deviator, deviator))}
        for i, j in ("xx", "yy", "zz", "xy", "yz", "xz"):
            scalars[f"stress_{i}{j}"] = sigma["xyz".index(i), "xyz".index(j)]
        points = interpolation_points(cellwise)
        self.stresses = [
            (fem.Function(cellwise, name=name), fem.Expression(scalar, points))
            for name, scalar in scalars.items()
        ]
        self.path = directory / "punch.pvd"
        self._file = VTKFile(punch.comm, str(self.path), "w")

    def write(self, step: float) -> None:
        """Write the present state as time ``step``.  Collective."""
        contact = self.contact
        slip = self.slip.x.array.reshape(-1, 3)
        slip[contact.nodes] = contact.slip_increment @ contact.frame[:2]
        self.slip.x.scatter_forward()
        for function, expression in self.stresses:
            function.interpolate(expression)
        names = ("gap", "load_function", "pressure", "area", "dissipation")
        fields = [self.u, contact.reaction_function(), self.slip]
        fields += [contact.function(getattr(contact, name), name) for name in names]
        fields.append(contact.function(contact.status, "status", elsewhere=-1))
        self._file.write_function(fields + [function for function, _ in self.stresses], step)

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self._file.close()
