"""Sequence folders and recordings, written, read and done again."""
