"""Bodies as DOLFINx assembles them, without a word of contact."""
