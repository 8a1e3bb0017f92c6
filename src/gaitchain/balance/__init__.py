"""One control period: sensors to servo targets, compiled by Numba."""
