"""A robot's file to its legs, soles, knees and servos, with the evidence."""
