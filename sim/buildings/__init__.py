"""Buildings: floor plans, furniture and doors, drawn by a procedure or read from files, and checked."""
