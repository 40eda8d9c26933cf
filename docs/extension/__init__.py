# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What the site needs beyond Sphinx and well-kept extensions; each module says in its second sentence why it is none of these."""
