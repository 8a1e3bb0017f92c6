"""DYNAMIXEL: what its X series has of its own."""
