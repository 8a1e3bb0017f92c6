"""The closed loop online: sensors to servo targets, compiled where Numba is."""
