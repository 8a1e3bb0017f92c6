"""Proof of a library: how often it falls, and how sure that is. Ours."""
