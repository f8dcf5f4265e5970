"""The rival of the paper's Table 1: maps merged one after another; read ``sequential`` first."""
