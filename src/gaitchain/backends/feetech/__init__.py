"""Feetech's STS servos: packets, table, and an emulated bus; the rest is shared."""
