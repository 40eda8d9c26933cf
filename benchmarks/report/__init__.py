"""Error against run time, as one page."""
