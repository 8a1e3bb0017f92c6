"""Numerical models of the robot: the reduced biped, the jointed legs, and storage."""
