from dolfinx_contact import _kernel as _kernel
