"""The stress matrix: every scene times every solver."""
