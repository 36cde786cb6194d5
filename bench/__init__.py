"""Measurements beside rivals: run them on the machine that matters, believe nothing else."""
