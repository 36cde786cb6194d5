"""The simulated robot: room, camera, body and board, in one virtual time."""
