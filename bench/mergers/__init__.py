"""Who is scored: this project's methods, Python functions and outside commands, each run apart from the bench."""
