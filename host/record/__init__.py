"""Sequence folders, read and written."""
