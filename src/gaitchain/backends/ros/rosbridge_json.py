"""Messages between rosbridge client and server: JSON of the rosbridge protocol, v2."""

import json
from typing import Any

import msgspec
import numpy as np

from gaitchain.backends.ros.messages import M, Message, TriggerResponse, as_array
from gaitchain.errors import BackendError

# Beside what is no JSON or of other types: numbers beyond doubles, and deep nesting.
_MALFORMED = ValueError, TypeError, OverflowError, RecursionError


class Said(msgspec.Struct, frozen=True):
    """A message from the server."""

    op: str
    topic: str = ""
    """Topic of a published message, else empty."""
    msg: Any = None
    service: str = ""
    """Name of a service that is called, else empty."""
    id: str | None = None
    """Of the call."""


def advertise(topic: str, kind: type[Message], *, latched: bool = False) -> str:
    """Return the announcement that a topic will be published."""
    return _say(op="advertise", topic=topic, type=kind.type_name, latch=latched)


def advertise_service(service: str) -> str:
    """Return the announcement of a service without arguments."""
    return _say(op="advertise_service", service=service, type="std_srvs/srv/Trigger")


def service_response(call: Said, answer: TriggerResponse) -> str:
    """Return the answer to a call."""
    return _say(
        op="service_response",
        service=call.service,
        id=call.id,
        values=answer,
        result=True,  # of the call; whether it had success is in the values
    )


def subscribe(topic: str, kind: type[Message]) -> str:
    """Return the subscription to a topic; a slow reader gets the latest message."""
    return _say(op="subscribe", topic=topic, type=kind.type_name, queue_length=1)


def publish(topic: str, message: Message) -> str:
    """Return a message to publish.

    It has all fields, because a rosbridge would stamp a header without a stamp.
    """
    return _say(op="publish", topic=topic, msg=message)


def read(text: str | bytes) -> Said:
    """Parse a message from the server.

    Raises:
        BackendError: the text is no JSON of the protocol, or reports an error.
    """
    try:
        # Not msgspec: a rosbridge may send NaN, which is no valid JSON.
        said = msgspec.convert(json.loads(text), Said)
    except (*_MALFORMED, msgspec.ValidationError) as error:
        raise BackendError(f"rosbridge said what is no message: {error}") from error
    if said.op == "status":
        raise BackendError(f"rosbridge: {said.msg}")
    return said


def message(kind: type[M], said: Said) -> M:
    """Return the published message, with NaN for null.

    Raises:
        BackendError: the message is not of that type.
    """
    try:
        return msgspec.convert(_with_nan(said.msg), kind, dec_hook=as_array)
    except (*_MALFORMED, msgspec.ValidationError) as error:
        raise BackendError(
            f"rosbridge: message on {said.topic} is no {kind.type_name}: {error}"
        ) from error


def _with_nan(value: Any) -> Any:
    """Replace null by NaN at all levels."""
    if isinstance(value, dict):
        return {key: _with_nan(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_with_nan(part) for part in value]
    return float("nan") if value is None else value


def _say(**fields: Any) -> str:
    return msgspec.json.encode(fields, enc_hook=np.ndarray.tolist).decode()
