"""ROS 2 messages in CDR, and the definitions of their types, by the package rosbags."""

import functools

import msgspec
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from gaitchain.backends.ros.messages import (
    DecisionMessage,
    M,
    Message,
    TriggerResponse,
    as_array,
)
from gaitchain.errors import BackendError


def encode(message: Message) -> bytes:
    """Encode a message as little-endian CDR with its header of four bytes."""
    return bytes(_types().serialize_cdr(message, message.type_name))


def decode(kind: type[M], payload: bytes) -> M:
    """Decode a message of a given type from CDR.

    Raises:
        BackendError: the bytes are no such message.
    """
    try:
        found = _types().deserialize_cdr(payload, kind.type_name)
        return msgspec.convert(found, kind, from_attributes=True, dec_hook=as_array)
    except (SerdeError, msgspec.ValidationError, ValueError) as error:
        raise BackendError(
            f"{len(payload)} bytes are no {kind.type_name}: {error}"
        ) from error


@functools.cache
def type_hash(type_name: str) -> str:
    """Return the hash of a type's definition, "RIHS01_" and 64 hexadecimal digits."""
    return _types().hash_rihs01(type_name)


def definition(type_name: str) -> str:
    """Return a type's definition with those of its parts, in the format of MCAP."""
    return _types().generate_msgdef(type_name, ros_version=2)[0]


@functools.cache
def _types() -> Typestore:
    """Return the standard types, equal in all ROS 2 releases, and gaitchain's own."""
    found = get_typestore(Stores.ROS2_JAZZY)
    for own in (DecisionMessage, TriggerResponse):
        found.register(get_types_from_msg(own.definition, own.type_name))
    return found
