"""What a run leaves behind: tables and checkpoints."""
