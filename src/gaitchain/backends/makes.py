"""The makes of servos by name; light, as the command line's options list them."""

from typing import Literal, get_args

MakeName = Literal["dynamixel", "feetech"]
"""Name of a make, in calibrations and options: that of its package beside this file."""
MAKES: tuple[MakeName, ...] = get_args(MakeName)
LEAST_BAUD, MOST_BAUD = 9600, 4_500_000
"""Rates of a servo bus, in calibrations and options [bit/s]."""
