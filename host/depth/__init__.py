"""Metric depth of regions and vertices from the tracked net and the camera's own motion."""
