"""What a rosbridge's client and server say: JSON of the rosbridge protocol, v2."""

import json
from typing import Any, TypeVar

import msgspec

from gaitchain.backends.ros.messages import Message, as_array
from gaitchain.errors import BackendError
from gaitchain.messages import Array

M = TypeVar("M", bound=Message)


class Said(msgspec.Struct, frozen=True):
    """What a server says."""

    op: str
    topic: str = ""
    """Empty for what is no message."""
    msg: Any = None


def advertise(topic: str, kind: type[Message]) -> str:
    """Return that a topic will be published."""
    return _say(op="advertise", topic=topic, type=kind.type_name)


def subscribe(topic: str, kind: type[Message]) -> str:
    """Return that a topic is wanted; of a slow reader's messages only the latest."""
    return _say(op="subscribe", topic=topic, type=kind.type_name, queue_length=1)


def publish(topic: str, message: Message) -> str:
    """Return the message, all its fields: a rosbridge stamps a header without stamp."""
    return _say(op="publish", topic=topic, msg=message)


def read(text: str | bytes) -> Said:
    """Read what a server says.

    Raises:
        BackendError: it is no JSON of the protocol, or the server complains.
    """
    try:
        # Not msgspec: a rosbridge may say NaN where JSON has no word for it.
        said = msgspec.convert(json.loads(text), Said)
    except (ValueError, msgspec.ValidationError) as error:
        raise BackendError(f"rosbridge said what is no message: {error}") from error
    if said.op == "status":
        raise BackendError(f"rosbridge: {said.msg}")
    return said


def message(kind: type[M], said: Said) -> M:
    """Return what was published, null as NaN.

    Raises:
        BackendError: it is not of that kind.
    """
    try:
        return msgspec.convert(_with_nan(said.msg), kind, dec_hook=as_array)
    except (ValueError, TypeError, msgspec.ValidationError) as error:
        raise BackendError(
            f"rosbridge: message on {said.topic} is no {kind.type_name}: {error}"
        ) from error


def _with_nan(value: Any) -> Any:
    """Replace null by NaN, wherever it is."""
    if isinstance(value, dict):
        return {key: _with_nan(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_with_nan(part) for part in value]
    return float("nan") if value is None else value


def _say(**fields: Any) -> str:
    return msgspec.json.encode(fields, enc_hook=_numbers).decode()


def _numbers(value: Array) -> list[float]:
    return list(value.tolist())
