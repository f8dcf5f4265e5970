"""What turns red: a run compared with a baseline, score by score and seed by seed."""
