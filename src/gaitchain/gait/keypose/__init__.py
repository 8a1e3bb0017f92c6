"""The gait of the paper: key poses made of primitives, joined by cubic segments."""
