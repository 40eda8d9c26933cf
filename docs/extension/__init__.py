"""What the site needs beyond Sphinx: pages whose code is run, the gallery of demos, docstrings, formulas as MathML."""
