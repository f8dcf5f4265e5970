"""What the command line reads and writes: maps from YAML, folders and MCAP; ``result.json``, the picture, the graph."""
