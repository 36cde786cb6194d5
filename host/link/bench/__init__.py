"""The serial protocol test bench: what the line to a robot is worth, measured and said in plain words."""
