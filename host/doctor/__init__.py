"""What is wrong with this robot, its camera or this computer, and how to mend it."""
