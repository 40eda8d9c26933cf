#include <pybind11/pybind11.h>

PYBIND11_MODULE(_kernel, m)
{
  m.doc() = "Kernel of dolfinx_contact: friction law, cone and maps on NumPy arrays.";
}
