"""One control period: sensors to servo targets, compiled where Numba is installed."""
