"""Maps: occupancy mapping, scan matching, submaps and how they lie under the truth."""
