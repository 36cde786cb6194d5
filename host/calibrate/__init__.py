"""Measuring what differs from robot to robot."""
