"""Write the reference in docs/api.md anew: `python docs/api_reference.py`.

It is made of the OpenAPI document that the service serves; what stands above it in the
file stays as it is.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gaitchain.service.api import bare_app
from gaitchain.service.api_limits import ApiLimits
from gaitchain.service.api_schema import complete

FILE = Path(__file__).with_name("api.md")
_MARK = "<!-- Made by docs/api_reference.py from here on. -->\n"
_LIMITS = """
## Limits

| what | limit |
|---|---|
| clients of the stream | %(sockets)d |
| clients of the 3-D view | %(viewers)d |
| connections | %(connections)d |
| requests of one address | %(requests_per_s)g a second; 429, %(refused_s)g s later |
| line and headers of a request | %(head_bytes)d bytes; 400 |
| lines of a request's head and chunks | %(lines)d; closed |
| body of a request | %(body_bytes)d bytes; 413 |
| a request and its answer | %(request_s)g s |
| new footsteps, of all | %(footsteps_per_s)g a second, %(footsteps)d at once; 429 |
| message on the stream | %(message_bytes)d bytes |
| messages of one client | %(messages_per_s)g a second; closed with 1008 |
| its frames, with pings and fragments | %(frames_per_s)g a second; closed with 1008 |
| messages that cannot be read | %(bad_messages)d, and one a second; closed with 1008 |
| a client that takes nothing | %(stalled_s)g s; closed |
"""


def api_markdown() -> str:
    """Return the text of docs/api.md with its reference as it should be."""
    prose, mark, _ = FILE.read_text("utf-8").partition(_MARK)
    document = complete(bare_app())
    lines = [prose + mark + _LIMITS % vars(ApiLimits()), "## Routes", ""]
    for path, methods in document["paths"].items():
        for method, route in methods.items():
            lines += _route(f"{method.upper()} {path}", route)
    lines += [
        "## Messages",
        "",
        "null is what nobody measured, or has, unless a message says otherwise.",
        "",
    ]
    for name, schema in document["components"]["schemas"].items():
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
    if "enum" in schema:
        yield _type(schema)
    if "prefixItems" in schema:
        yield f"- an array: {_array(schema)}"
    for field, part in schema.get("properties", {}).items():
        says = f": {_plain(part['description'])}" if "description" in part else ""
        yield f"- `{field}` ({', '.join([_type(part), *_bounds(part)])}){says}"
    yield ""


def _bounds(schema: dict[str, Any]) -> Iterator[str]:
    """Yield what a field may be besides its type, and what it is if left out."""
    if "exclusiveMinimum" in schema:
        yield f"above {schema['exclusiveMinimum']:g}"
    for least, most, unit in (
        ("minimum", "maximum", ""),
        ("minLength", "maxLength", " characters"),
        ("minItems", "maxItems", " items"),
    ):
        if "prefixItems" in schema:  # their type says how many there are
            continue
        if least in schema and most in schema:
            yield f"{schema[least]:g} to {schema[most]:g}{unit}"
        elif most in schema:
            yield f"at most {schema[most]:g}{unit}"
    if schema.get("default") not in (None, []):
        yield f"default {json.dumps(schema['default'])}"


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
    FILE.write_text(api_markdown(), "utf-8")
