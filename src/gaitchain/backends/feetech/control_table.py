"""Addresses and units of the STS series' memory table, after Feetech's own SDK.

Addresses beyond the SDK's are those of Feetech's memory table of the STS series.
"""

from gaitchain.backends.servos.table import Block, Model

SIZE = 87
MODEL = Block(3, 2)
ID = Block(5, 1)
RETURN_DELAY = Block(7, 1)  # [2 us]
STATUS_LEVEL = Block(8, 1)  # 0: answers only reads and pings
LOWEST_POSITION = Block(9, 2)
HIGHEST_POSITION = Block(11, 2)
TEMPERATURE_LIMIT = Block(13, 1)
MODE = Block(33, 1)
TORQUE = Block(40, 1)
ACCELERATION = Block(41, 1)  # 0 is unlimited
GOAL = Block(42, 2)
GOAL_TIME, GOAL_SPEED = Block(44, 2), Block(46, 2)  # 0 is unlimited
TORQUE_LIMIT = Block(48, 2)  # [0.1 %]
POSITION = Block(56, 2)
VELOCITY = Block(58, 2)  # [counts/s]
VOLTAGE = Block(62, 1)  # [0.1 V]
TEMPERATURE = Block(63, 1)
STATUS = Block(65, 1)
CURRENT = Block(69, 2)

SETUP = Block(RETURN_DELAY.address, MODE.end - RETURN_DELAY.address)
PRESENT = Block(POSITION.address, CURRENT.end - POSITION.address)
STATE = Block(TORQUE.address, STATUS.end - TORQUE.address)
MOTION = Block(ACCELERATION.address, TORQUE_LIMIT.end - ACCELERATION.address)
"""Acceleration, goal, time, speed, torque limit."""
POSITION_MODE = 0
SIGN = 15
"""Bit that makes a position, velocity or current negative."""
MODELS = {777: Model("sts3215", 0.0065), 2825: Model("sts3250", 0.0065)}
ERRORS = {
    **{0: "supply voltage", 1: "encoder", 2: "overheating", 3: "current"},
    5: "overload",
}
"""Meaning of the bits of the status, and of an answer's error byte."""


def signed(number: int) -> int:
    """Return the value of a number whose highest bit is its sign."""
    size = number & ~(1 << SIGN)
    return -size if number >> SIGN & 1 else size
