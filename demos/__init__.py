"""Demos: text notebooks; ``python demos/demo_hertz.py`` runs one, ``python -m demos.demo_punch`` the punch."""
