"""Access control for every route, socket and file, and for the 3-D view."""

import asyncio
import hmac
import ipaddress
import re
import socket
from urllib.parse import quote, unquote

import msgspec
from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from gaitchain.service.api_limits import Allowance, ApiLimits
from gaitchain.service.api_transport import DAMAGED
from gaitchain.service.schemas import Problem
from gaitchain.service.settings import Settings

COOKIE = "gaitchain_token"
"""Begin of the cookie's name; browsers keep those of all ports of a host together."""
API = "/api/v1"
VIEWER = "/viewer"
_STOPS = f"{API}/stop", f"{API}/emergency-stop"
_SAFE = ("GET", "HEAD", "OPTIONS")
_ADDRESSES = 1024  # whose requests are counted; more and counting begins anew
_HOST = re.compile(r"(\[(?P<address>[0-9a-f:.]+)\]|(?P<name>[a-z0-9_.-]+))(:[0-9]*)?")
_TOO_MANY = 429
_WILDCARDS = ("", "0.0.0.0", "::")
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "font-src 'self'; connect-src 'self'; frame-src 'self'; manifest-src 'self'; "
    "base-uri 'none'; form-action 'self'; frame-ancestors 'self'"
)
# The 3-D view is one file of inline scripts that unpack WebAssembly and start workers.
_VIEWER_POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob: data:; "
    "connect-src 'self' blob: data:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'self'"
)
_HEADERS = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
}
_WRONG = "wrong-token"  # query of the form after a sign-in that failed
_TOLD = '\n<p role="alert">This token is wrong. Nobody is signed in by it.</p>'
_FORM = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>gaitchain</title>
<meta name="viewport" content="width=device-width">
<h1>gaitchain</h1>
<form action="/" method="get">
<label>Token <input type="password" name="token" autocomplete="off" required></label>
<button>Sign in</button>
</form>%s
<p>The token is the one that the server was started with.</p>
</html>
"""


class Gate:
    """ASGI middleware that refuses what is not allowed in, and marks every answer."""

    def __init__(self, app: ASGIApp, settings: Settings, limits: ApiLimits) -> None:
        """Stand before an app."""
        self._app, self._token = app, settings.token
        self._host = settings.host.lower()
        self._limits = limits
        self._allowances: dict[str, Allowance] = {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request or a socket in, or answer it here."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        request = HTTPConnection(scope)
        marked = _marked(send, scope["path"])
        answer = self._answer(request)
        writes = scope["type"] == "http" and scope["method"] not in _SAFE
        if answer is None and writes and scope["path"] in _STOPS:
            # A stop waits for no body, and is done whatever stands in it.
            receive = _again(b"", receive)
            if _has_body(request):
                marked = _closing(marked)
        elif answer is None and writes:
            body = await _body(receive, self._limits.body_bytes)
            if scope["state"].get(DAMAGED):
                answer = problem(400, "the body is no valid HTTP")
            elif body is None:
                limit = f"the body is larger than {self._limits.body_bytes} bytes"
                answer = problem(413, limit, {"connection": "close"})
            else:
                receive = _again(body, receive)
        if answer is None:
            await self._app(scope, receive, marked)
        else:
            if answer.status_code == _TOO_MANY:
                await asyncio.sleep(self._limits.refused_s)
            await answer(scope, receive, marked)

    def _answer(self, request: HTTPConnection) -> Response | None:
        """Return the answer to what must not pass."""
        host = request.headers.get("host", "")
        if not self._is_ours(host):
            return problem(
                403, f"Host {host[:80]!r} is not this server, {self._host} or localhost"
            )
        scope, known = request.scope, self._knows(_presented(request))
        urgent = known and scope["path"] == f"{API}/emergency-stop"
        if not urgent and not self._allowance(request).take():
            most = f"more than {self._limits.requests_per_s:g} requests a second"
            return problem(_TOO_MANY, f"{most}: wait a second", {"retry-after": "1"})
        asked = scope.get("method"), scope["path"]
        opens = asked in (("GET", "/"), ("HEAD", "/"))
        if opens and "token" in request.query_params:
            return self._signed_in(request)
        signs_in = asked == ("POST", f"{API}/session")
        if not known and not signs_in:
            return _stranger(request)
        origin = request.headers.get("origin")
        if scope.get("method") in _SAFE or origin is None or _same(origin, host):
            return None
        return problem(403, f"Origin {origin[:80]!r} is not this server's")

    def _is_ours(self, host: str) -> bool:
        """Whether a Host header names this server."""
        # Another name: a page of somebody else's was made to point here (rebinding).
        name = _name_of(host)
        if name in ("localhost", self._host):
            return True
        try:
            address = ipaddress.ip_address(name)
        except ValueError:
            own = socket.gethostname().lower()
            return self._host in _WILDCARDS and name in (own, f"{own}.local")
        return address.is_loopback or self._host in _WILDCARDS

    def _knows(self, token: str) -> bool:
        return not self._token or same_secret(token, self._token)

    def _signed_in(self, request: HTTPConnection) -> Response:
        """Remember a token; redirect in any case, so that it leaves the address."""
        token = request.query_params["token"]
        if not self._knows(token):
            return RedirectResponse(f"/?{_WRONG}", 303)
        answer = RedirectResponse("/", 303)
        if self._token:
            remember(answer, request, token)
        return answer

    def _allowance(self, request: HTTPConnection) -> Allowance:
        address = request.client.host if request.client else ""
        if address not in self._allowances:
            if len(self._allowances) >= _ADDRESSES:
                self._allowances.clear()
            self._allowances[address] = Allowance(self._limits.requests_per_s)
        return self._allowances[address]


def same_secret(one: str, other: str) -> bool:
    """Compare in constant time, which does not show where they differ."""
    return hmac.compare_digest(
        one.encode(errors="surrogatepass"), other.encode(errors="surrogatepass")
    )


def cookie_of(port: int) -> str:
    """Return the name of the cookie of the server on a port."""
    return f"{COOKIE}_{port}"


def remember(answer: Response, request: HTTPConnection, token: str) -> None:
    """Put the token into a cookie that scripts and other sites cannot use."""
    value, name = quote(token, safe=""), cookie_of(_port(request))
    answer.set_cookie(name, value, path="/", httponly=True, samesite="strict")


def forget(answer: Response, request: HTTPConnection) -> None:
    """Take the cookie back."""
    name = cookie_of(_port(request))
    answer.delete_cookie(name, path="/", httponly=True, samesite="strict")


def _port(request: HTTPConnection) -> int:
    server = request.scope.get("server")
    return int(server[1] or 0) if server else 0


def problem(
    status: int, detail: str, headers: dict[str, str] | None = None
) -> Response:
    """Return an answer that says why a request was refused."""
    body = msgspec.json.encode(Problem(detail))
    return Response(body, status, headers, "application/json")


def _presented(request: HTTPConnection) -> str:
    """Return the token of a request, from its header or else its cookie."""
    kind, _, token = request.headers.get("authorization", "").partition(" ")
    if kind.lower() == "bearer":
        return token.strip()
    return unquote(request.cookies.get(cookie_of(_port(request)), ""))


def _stranger(request: HTTPConnection) -> Response:
    scope, told = request.scope, _TOLD if _WRONG in request.query_params else ""
    headers = {"www-authenticate": "Bearer"}
    if scope["path"] == "/" and scope["type"] == "http":
        return HTMLResponse(_FORM % told, 401, headers)
    return problem(401, "no token, or a wrong one: see docs/api.md", headers)


def _same(origin: str, host: str) -> bool:
    own = host.lower()
    return origin.lower() in (f"http://{own}", f"https://{own}")


def _name_of(host: str) -> str:
    """Return the name or address in a Host header; empty if it is none."""
    found = _HOST.fullmatch(host.lower())
    return (found["address"] or found["name"]).rstrip(".") if found else ""


def _marked(send: Send, path: str) -> Send:
    """Return a `send` that puts the security headers on an answer."""
    of_viewer = path == VIEWER or path.startswith(f"{VIEWER}/")

    async def marked(message: Message) -> None:
        if message["type"].endswith("response.start"):
            headers = MutableHeaders(raw=message.setdefault("headers", []))
            headers.update(_HEADERS)
            policy = _VIEWER_POLICY if of_viewer else _POLICY
            headers["content-security-policy"] = policy
            if not of_viewer:
                page = path.startswith("/page/")
                headers["cache-control"] = "no-cache" if page else "no-store"
        await send(message)

    return marked


def _has_body(request: HTTPConnection) -> bool:
    """Whether a body follows a request's headers."""
    length = request.headers.get("content-length", "0")
    return length != "0" or "transfer-encoding" in request.headers


def _closing(send: Send) -> Send:
    """Return a `send` that says that the connection ends with the answer."""

    async def closing(message: Message) -> None:
        if message["type"] == "http.response.start":
            MutableHeaders(raw=message.setdefault("headers", []))["connection"] = (
                "close"
            )
        await send(message)

    return closing


async def _body(receive: Receive, most: int) -> bytes | None:
    """Return a request's body, None if it is larger than `most` bytes."""
    body = b""
    while True:
        message = await receive()
        body += bytes(message.get("body", b""))
        if len(body) > most:
            return None
        if message["type"] == "http.disconnect" or not message.get("more_body"):
            return body


def _again(body: bytes, receive: Receive) -> Receive:
    """Return a `receive` that gives a body that was read, then what else comes."""
    left = [body]

    async def again() -> Message:
        if left:
            return {"type": "http.request", "body": left.pop(), "more_body": False}
        return await receive()

    return again
