"""docs/api.md, made of the OpenAPI document: `python -m gaitchain.service.api_doc`."""

import sys
from collections.abc import Iterator
from typing import Any

from gaitchain.service.api import bare_app
from gaitchain.service.api_limits import Limits
from gaitchain.service.api_schema import complete
from gaitchain.service.auth import COOKIE

_INTRO = """# HTTP API

Made by `python -m gaitchain.service.api_doc > docs/api.md` from the OpenAPI 3.1
document that the service serves at `/openapi.json`, there with the limits of its gait
library.

`gaitchain serve` answers on one port: the page at `/`, the 3-D view at `/viewer`, and
what follows under `/api/v1`. All bodies are JSON. What is refused comes with a 4xx
status and `{"detail": ...}`, which names the value and the limit.

    curl -X POST localhost:8700/api/v1/start
    curl -X PUT  localhost:8700/api/v1/command -H 'Content-Type: application/json' \\
         -d '{"vx": 0.2}'
    curl -X POST localhost:8700/api/v1/emergency-stop

## Who may come in

On loopback no token is needed. `--host` with another address needs `--token T`; then
every route, socket and file answers 401 without it. It is given as `Authorization:
Bearer T`, or as the cookie `%(cookie)s` (HttpOnly, SameSite=Strict), which `/?token=T`
and `POST /api/v1/session` set. Whoever has the token may drive, under any name.

A request whose `Host` is neither a loopback name nor the `--host` is refused, and so is
one that changes something, or opens a socket, with an `Origin` that is not this
server's (403). The server speaks plain HTTP: off loopback put a reverse proxy with TLS
before it, one that passes `Host` on, and give its name as `--host`.

## Driving

Drivers name themselves, 1 to 64 of `A-Z a-z 0-9 . _ -`: with the header `X-Driver`
(`rest` without it), on the stream with `?driver=`. The first to ask has the wheel until
it lets go or is silent for 3 s; others get 409 and watch. A command counts for 0.5 s,
then the robot stops walking: repeat it at 10 Hz. Anybody may stop the robot. The
emergency stop overtakes everything, and the limit on requests does not hold for it.

202 says that a request was passed on to the loop; what came of it is in the next
frames.

## Telemetry stream

`ws://HOST:PORT/api/v1/stream?hz=25&driver=NAME`, 1 to 100 frames a second. Text
messages from the server are a `Frame` (below) or `{"type": "error", "detail": ...}`;
the latter answers a message that was refused, and says so when the loop is silent. The
latest ten events are in every frame; their numbers say which are new.

The client may send

    {"type": "drive", "vx": 0.2, "vy": 0.0, "yaw_rate": 0.1}
    {"type": "push", "impulse_ns": 3.0, "direction_deg": 90}
    {"type": "stop"}      also start, rest, reset, emergency_stop, let_go

A socket that took the wheel, by whatever request, lets go when it closes. A slow
client misses frames, and gets the newest when it is ready.

## Limits

| what | limit |
|---|---|
| clients of the stream | %(sockets)d |
| clients of the 3-D view | %(viewers)d |
| connections | %(connections)d |
| requests of one address | %(requests_per_s)g a second; 429 |
| body of a request | %(body_bytes)d bytes; 413 |
| a request and its answer | %(request_s)g s |
| message on the stream | %(message_bytes)d bytes |
| messages of one client | %(messages_per_s)g a second; closed with 1008 |
| messages that cannot be read | %(bad_messages)d, and one a second; closed with 1008 |
| a client that takes nothing | %(stalled_s)g s; closed |
"""


def api_markdown() -> str:
    """Return the text of docs/api.md."""
    document = complete(bare_app())
    schemas = document["components"]["schemas"]
    facts = {**vars(Limits()), "cookie": COOKIE}
    lines = [_INTRO % facts, "## Routes", ""]
    for path, methods in document["paths"].items():
        for method, route in methods.items():
            lines += _route(f"{method.upper()} {path}", route)
    lines += ["## Messages", "", "null is what nobody measured.", ""]
    for name, schema in schemas.items():
        lines += _message(name, schema)
    return "\n".join(lines).rstrip() + "\n"


def _route(name: str, route: dict[str, Any]) -> Iterator[str]:
    yield from (f"### {name}", "", _plain(route["description"]), "")
    for parameter in route.get("parameters", ()):
        kind = _type(parameter["schema"])
        default = parameter["schema"].get("default")
        yield (
            f"- `{parameter['name']}` ({parameter['in']}, {kind}, default {default}): "
            f"{parameter['description']}"
        )
    body = route.get("requestBody")
    if body is not None:
        yield f"- body: {_content(body)}"
    for status, answer in sorted(route["responses"].items()):
        if int(status) < 300 or _content(answer) != "`Problem`":
            yield f"- {status}: {_content(answer) or 'no content'}"
    refusals = [s for s, a in route["responses"].items() if _content(a) == "`Problem`"]
    yield from (f"- refused with {', '.join(sorted(refusals))}", "")


def _message(name: str, schema: dict[str, Any]) -> Iterator[str]:
    yield from (f"### {name}", "", _plain(schema.get("description", "")), "")
    for field, part in schema.get("properties", {}).items():
        told = f": {_plain(part['description'])}" if "description" in part else ""
        yield f"- `{field}` ({_type(part)}){told}"
    yield ""


def _content(part: dict[str, Any]) -> str:
    content = part.get("content", {}).get("application/json", {})
    return _type(content["schema"]) if "schema" in content else ""


def _type(schema: dict[str, Any]) -> str:
    """Name the type of a JSON schema."""
    if "$ref" in schema:
        return f"`{schema['$ref'].rpartition('/')[2]}`"
    if "enum" in schema:
        return " or ".join(f'"{value}"' for value in schema["enum"])
    if "anyOf" in schema:
        return " or ".join(map(_type, schema["anyOf"]))
    kind = str(schema.get("type", "anything"))
    if kind == "array":
        return _array(schema)
    if kind == "object" and isinstance(schema.get("additionalProperties"), dict):
        return f"object of {_type(schema['additionalProperties'])}"
    return kind


def _array(schema: dict[str, Any]) -> str:
    if "prefixItems" not in schema:
        return f"array of {_type(schema['items'])}"
    parts = [_type(part) for part in schema["prefixItems"]]
    return parts[0] if len(parts) == 1 else f"[{', '.join(parts)}]"


def _plain(text: str) -> str:
    return " ".join(text.split())


if __name__ == "__main__":
    sys.stdout.write(api_markdown())
