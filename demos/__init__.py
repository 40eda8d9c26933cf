"""Demos, text notebooks: ``python demos/demo_hertz.py [picture.png]``; the punch: ``python -m demos.demo_punch``."""
