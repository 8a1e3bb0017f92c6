"""Addresses and units of the X-series control table, after the ROBOTIS e-Manual.

MX servos with the firmware for protocol 2.0 have the same table.
"""

import math

from gaitchain.backends.servos.table import Block, Model

RAD_S_PER_COUNT = 0.229 * 2.0 * math.pi / 60.0  # 0.229 rev/min
FULL_PWM = 885  # register value of 100 %
POSITION_MODE = 3
WATCHDOG_UNIT_S = 0.02
WATCHDOG_MOST = 127
WATCHDOG_TRIPPED = 0xFF  # -1 as a signed byte
ALERT = 0x80  # bit of a status packet's error byte that reports a hardware error
HARDWARE_ERRORS = {
    0: "supply voltage",
    2: "overheating",
    3: "encoder",
    4: "electrical shock",
    5: "overload",
}
"""Meaning of the bits of the hardware error status."""


RETURN_DELAY = Block(9, 1)  # [2 us]
OPERATING_MODE = Block(11, 1)
TEMPERATURE_LIMIT = Block(31, 1)
PWM_LIMIT = Block(36, 2)
HIGHEST_POSITION = Block(48, 4)
LOWEST_POSITION = Block(52, 4)
TORQUE = Block(64, 1)
STATUS_LEVEL = Block(68, 1)
HARDWARE_ERROR = Block(70, 1)
WATCHDOG = Block(98, 1)
GOAL_PWM = Block(100, 2)
PROFILE = Block(108, 8)  # acceleration, then velocity; 0 is unlimited
GOAL = Block(116, 4)
CURRENT = Block(126, 2)
VELOCITY = Block(128, 4)
POSITION = Block(132, 4)
VOLTAGE = Block(144, 2)  # [0.1 V]
TEMPERATURE = Block(146, 1)

PROFILE_AND_GOAL = Block(PROFILE.address, GOAL.end - PROFILE.address)
PRESENT = Block(CURRENT.address, POSITION.end - CURRENT.address)
SETUP = Block(RETURN_DELAY.address, LOWEST_POSITION.end - RETURN_DELAY.address)
STATE = Block(TORQUE.address, WATCHDOG.end - TORQUE.address)
SUPPLY = Block(VOLTAGE.address, TEMPERATURE.end - VOLTAGE.address)

PRESENT_FORMAT = "<hii"
"""`struct` format of current, velocity and position in `PRESENT`."""


_NO_CURRENT = math.nan
MODELS = {
    number: Model(name, amperes)
    for amperes, names in {
        0.00269: {
            **{1000: "xh430-w350", 1010: "xh430-w210", 1001: "xd430-t350"},
            **{1011: "xd430-t210", 1020: "xm430-w350", 1030: "xm430-w210"},
            **{1100: "xh540-w270", 1110: "xh540-w150", 1101: "xd540-t270"},
            **{1111: "xd540-t150", 1120: "xm540-w270", 1130: "xm540-w150"},
            **{1140: "xh540-v270", 1150: "xh540-v150", 1170: "xw540-t260"},
            **{1180: "xw540-t140", 1270: "xw430-t333", 1280: "xw430-t200"},
            1310: "xw540-h260",
        },
        0.00134: {1040: "xh430-v350", 1050: "xh430-v210"},
        0.001: {
            **{1190: "xl330-m077", 1200: "xl330-m288", 1210: "xc330-t181"},
            **{1220: "xc330-t288", 1230: "xc330-m181", 1240: "xc330-m288"},
        },
        0.00336: {311: "mx-64", 321: "mx-106"},
        _NO_CURRENT: {
            **{1060: "xl430-w250", 1070: "xc430-w150", 1080: "xc430-w240"},
            **{1090: "2xl430-w250", 1160: "2xc430-w250", 30: "mx-28"},
        },
    }.items()
    for number, name in names.items()
}
