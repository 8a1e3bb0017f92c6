"""Logs of what the loop did, in MCAP."""
