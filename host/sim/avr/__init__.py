"""The real firmware in a simulated ATmega328P; see README.md for its licence."""
