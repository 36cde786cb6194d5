"""Sources of frames behind one URI, and the lens they look through."""
