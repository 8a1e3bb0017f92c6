"""The OpenAPI document, with the answers, tokens and limits that FastAPI omits."""

import ast
import inspect
import re
from itertools import pairwise
from typing import Any

import msgspec
from fastapi import FastAPI

from gaitchain.gait.command_range import AXES, CommandRange
from gaitchain.service import schemas
from gaitchain.service.api_feed import LOOP_SILENT
from gaitchain.service.auth import COOKIE
from gaitchain.sim.bodies import ANY_BODY

_COMPONENTS = "#/components/schemas/"
# Made of a loop's numbers, and NaN is null in JSON.
_MAY_BE_UNKNOWN = ("TelemetryFrame", "Scene", "Choice", "Going")
_IN_JSON = re.compile(r"\b(None|NaN)\b")
_WHY = {
    202: "Passed on to the loop.",
    401: "No token, or a wrong one.",
    403: "The Host or the Origin header is not this server's.",
    404: "There is none.",
    409: "Another one drives, or this robot or log cannot.",
    413: "The body is too large.",
    422: "A value is of the wrong kind, or beyond a limit; `detail` names both.",
    429: "Too many requests.",
    503: f"{LOOP_SILENT.capitalize()}.",
}
_PROBLEM = {
    "application/json": {"schema": {"$ref": f"{_COMPONENTS}{schemas.Problem.__name__}"}}
}


def answers(
    statuses: tuple[int, ...],
    content: type[msgspec.Struct] | None,
    refusals: tuple[int, ...],
) -> dict[int | str, dict[str, Any]]:
    """Return what a route may answer, as FastAPI wants it.

    Args:
        statuses: when all goes well, and others with the same content.
        content: what is sent then.
        refusals: other statuses; with a `Problem`.
    """
    found: dict[int | str, dict[str, Any]] = {
        code: {"description": _WHY[code], "content": _PROBLEM}
        for code in sorted(refusals)
    }
    for status in statuses:
        found[status] = {"description": _WHY.get(status, "All went well.")}
        if content is not None:
            schema = {"schema": {"$ref": f"{_COMPONENTS}{content.__name__}"}}
            found[status]["content"] = {"application/json": schema}
    return found


def complete(
    app: FastAPI,
    span: CommandRange | None = None,
    limits: schemas.DisturbanceLimits | None = None,
) -> dict[str, Any]:
    """Return an app's OpenAPI document, and make it the one that is served.

    Args:
        app: with its routes.
        span: what the library walks; without it the document has no limits.
        limits: of what disturbs the robot, if it is simulated.
    """
    document = app.openapi()
    parts = document["components"]
    _, components = msgspec.json.schema_components(
        schemas.ANSWERS, ref_template=_COMPONENTS + "{name}"
    )
    for name in _MAY_BE_UNKNOWN:
        components[name] = _nullable(components[name])
    for struct in schemas.ANSWERS:
        _describe(components[struct.__name__]["properties"], struct)
    parts["schemas"] |= components
    for unused in ("HTTPValidationError", "ValidationError"):
        parts["schemas"].pop(unused, None)
    parts["securitySchemes"] = {
        "bearer": {"type": "http", "scheme": "bearer"},
        "cookie": {"type": "apiKey", "in": "cookie", "name": f"{COOKIE}_PORT"},
    }
    document["security"] = [{"bearer": []}, {"cookie": []}]
    if span is not None:
        _set_limits(parts["schemas"]["Motion"]["properties"], span)
    if limits is not None:
        pushed = parts["schemas"]["PushRequest"]["properties"]
        pushed["body"]["enum"] = [*limits.bodies, ANY_BODY]
        punched = parts["schemas"]["PunchesRequest"]["properties"]
        for impulse in (pushed["impulse_ns"], punched["most_ns"]):
            impulse["maximum"] = limits.impulse_ns
    app.openapi_schema = document
    return document


def _set_limits(properties: dict[str, Any], span: CommandRange) -> None:
    for name, (least, most) in zip(AXES, span.limits, strict=True):
        properties[name] |= {"minimum": least, "maximum": most}
    properties["crouch"] |= {"minimum": 0.0, "maximum": span.crouch[0]}


def _describe(properties: dict[str, Any], struct: type[msgspec.Struct]) -> None:
    """Add what the source says under each field, also of what a struct inherits."""
    for part in reversed(struct.__mro__):
        if part is msgspec.Struct or not issubclass(part, msgspec.Struct):
            continue
        try:
            (stated,) = ast.parse(inspect.getsource(part)).body
        except OSError:  # no source is installed
            continue
        for field, text in pairwise(getattr(stated, "body", [])):
            match field, text:
                case (
                    ast.AnnAssign(target=ast.Name(id=name)),
                    ast.Expr(value=ast.Constant(value=str(said))),
                ):
                    said = _IN_JSON.sub("null", " ".join(said.split()))
                    properties[name.rstrip("_")]["description"] = said


def _nullable(schema: Any) -> Any:
    """Return a JSON schema in which every number may be null."""
    if isinstance(schema, list):
        return [_nullable(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    if schema.get("type") == "number":
        return {"anyOf": [schema, {"type": "null"}]}
    return {name: _nullable(part) for name, part in schema.items()}
