"""What a merge is worth: every score, defined by the docstring of its file, from a prediction and the truth."""
