"""Identification: what one robot is, from the log of safe motions. Ours."""
