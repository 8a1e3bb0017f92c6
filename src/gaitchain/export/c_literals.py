"""Numbers and texts as they are written in C."""

import math


def literal(value: float) -> str:
    """Return a number in C, all its digits."""
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    return repr(float(value))


def text_literal(text: str) -> str:
    """Return a text in C, in UTF-8."""
    return f'"{"".join(map(_character, text.encode("utf-8", "replace")))}"'


def _character(byte: int) -> str:
    if chr(byte) in '"\\?':  # a question mark could be of a trigraph
        return f"\\{chr(byte)}"
    # Three octal digits: a hexadecimal number would go on in the text behind it.
    return chr(byte) if 0x20 <= byte < 0x7F else f"\\{byte:03o}"
