"""Access control: by token, by the requested Host, and by the Origin of a web page.

A web page in a browser can reach a service on the same computer. The Host check blocks names that an attacker
resolves to 127.0.0.1 (DNS rebinding). The Origin check blocks foreign pages; it includes WebSockets, to which
browsers do not apply the same-origin policy.
"""

import asyncio
import contextlib
import hmac
import ipaddress
import json
from dataclasses import dataclass
from urllib.parse import SplitResult, parse_qs, urlsplit

from starlette.types import ASGIApp, Message, Receive, Scope, Send

SUBPROTOCOL = "contactsense"
"""Subprotocol in the answer to a WebSocket that sends its token as a subprotocol."""
TOKEN_PREFIX = "bearer."
"""Prefix of the token in a WebSocket subprotocol."""
OPEN_PATHS = ("/v1/ready", "/docs", "/openapi.json")
"""Beginnings of paths that need no token: whether the service is ready, and the description of the
interface. The root only leads there."""
_PORTS = {"http": 80, "https": 443}
"""Scheme of a web page -> its usual port."""
_LINGER = 2.0
"""Longest time for which the body of a refused request is read and discarded [s]."""


@dataclass(frozen=True, slots=True)
class AccessRules:
    """Rules of access."""

    token: str | None = None
    """Token that each request must send; None: no token is needed."""
    hosts: tuple[str, ...] = ()
    """Accepted host names in addition to localhost; IP addresses are always accepted."""
    origins: tuple[str, ...] = ()
    """Origins of web pages, in addition to the service's own, that may use it, such as
    https://panel.example."""


def host_names(names: tuple[str, ...]) -> tuple[str, ...]:
    """Host names as requests have them.

    Raises:
        ValueError: One is no name alone, and would never be equal to that of a request.
    """
    found = []
    for name in filter(None, names):  # an empty variable means none
        try:
            if set(name) & set("/:@ *,"):
                raise ValueError
            found.append(_in_ascii(name))
        except ValueError:
            raise ValueError(f"expected host names alone, such as panel.example, got {name!r:.80}") from None
    return tuple(found)


def page_origins(origins: tuple[str, ...]) -> tuple[str, ...]:
    """Origins as browsers send them.

    Raises:
        ValueError: One is no origin, and would never be equal to that of a request.
    """
    found = []
    for origin in filter(None, origins):
        try:
            found.append(_as_sent(urlsplit(origin)))
        except ValueError:
            raise ValueError(f"expected origins such as https://panel.example, got {origin!r:.80}") from None
    return tuple(found)


def _as_sent(origin: SplitResult) -> str:
    """An origin as browsers send it: without the usual port of its scheme.

    Raises:
        ValueError: It is none.
    """
    usual, name = _PORTS.get(origin.scheme), origin.hostname
    more = origin.path.strip("/"), origin.query, origin.fragment, origin.username, origin.password
    if usual is None or not name or set(name) & set(" *,") or any(more):
        raise ValueError
    name = f"[{name}]" if ":" in name else _in_ascii(name)
    return f"{origin.scheme}://{name}" + ("" if origin.port in (None, usual) else f":{origin.port}")


def _in_ascii(name: str) -> str:
    """A host name as requests have it: in small letters, and those beyond ASCII in Punycode.

    Raises:
        ValueError: No host has such a name.
    """
    return name.lower().encode("idna").decode("ascii")


class Access:
    """ASGI middleware: answers 400 to a foreign Host, 403 to a foreign Origin, and 401 to a wrong token."""

    def __init__(self, app: ASGIApp, rules: AccessRules) -> None:
        self._app = app
        self._rules = rules
        self._hosts = {"localhost", *(host.lower() for host in rules.hosts)}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on permitted requests."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {
            name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]
        }
        refusal = self._refusal(scope, headers)
        if refusal is not None:
            await refuse(scope, receive, send, *refusal)
            return
        offered = scope.get("subprotocols", [])
        await self._app(scope, receive, _choosing(send) if SUBPROTOCOL in offered else send)

    def _refusal(self, scope: Scope, headers: dict[str, str]) -> tuple[int, str, str] | None:
        host = headers.get("host", "")
        if not self._known(host):
            return (
                400,
                "Host",
                "expected localhost, an address in numbers, or a name given by --allowed-host, got "
                f"{host!r:.80}",
            )
        origin = headers.get("origin")
        if origin is not None and not self._welcome(origin, host):
            return (
                403,
                "Origin",
                f"expected a page of this service or one given by --allowed-origin, got {origin!r:.80}",
            )
        if self._rules.token is None or scope["path"] == "/" or scope["path"].startswith(OPEN_PATHS):
            return None
        token = _token(scope, headers)
        if token is None:
            return 401, "Authorization", "expected Authorization: Bearer and the service's token, got none"
        if not hmac.compare_digest(token.encode(), self._rules.token.encode()):
            return 401, "Authorization", "the token is wrong"
        return None

    def _known(self, host: str) -> bool:
        name = _hostname(host)
        return name in self._hosts or _is_address(name)

    def _welcome(self, origin: str, host: str) -> bool:
        try:
            own = urlsplit(origin).netloc.lower() == host.lower()
        except ValueError:
            return False
        return own or origin in self._rules.origins


async def refuse(
    scope: Scope, receive: Receive, send: Send, status: int, field: str, reason: str, retry: int | None = None
) -> None:
    """Answer a request, or a WebSocket before its handshake, with an error, and close the connection."""
    body = json.dumps({"errors": [{"field": field, "reason": reason}]}).encode()
    headers = [
        (b"content-type", b"application/json"),
        (b"content-length", str(len(body)).encode()),
        (b"connection", b"close"),
    ]
    if status == 401:
        headers.append((b"www-authenticate", b"Bearer"))
    if retry is not None:
        headers.append((b"retry-after", str(retry).encode()))
    kind = "http.response"
    if scope["type"] == "websocket":
        await receive()
        if "websocket.http.response" not in scope.get("extensions", {}):
            await send({"type": "websocket.close", "code": 1008})
            return
        kind = "websocket.http.response"
    await send({"type": f"{kind}.start", "status": status, "headers": headers})
    if scope["type"] == "http":
        # Closing at once would reset the connection: a client that is still sending would lose the answer.
        await send({"type": f"{kind}.body", "body": body, "more_body": True})
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_LINGER):
                while (await receive()).get("more_body"):
                    pass
        body = b""
    await send({"type": f"{kind}.body", "body": body})


def _choosing(send: Send) -> Send:
    """Adds the subprotocol to the handshake: browsers disconnect if none of theirs is chosen."""

    async def choose(message: Message) -> None:
        if message["type"] == "websocket.accept" and not message.get("subprotocol"):
            message = {**message, "subprotocol": SUBPROTOCOL}
        await send(message)

    return choose


def _token(scope: Scope, headers: dict[str, str]) -> str | None:
    scheme, _, token = headers.get("authorization", "").partition(" ")
    if scheme.lower() == "bearer" and token:
        return token.strip()
    if scope["type"] == "websocket":
        for name in scope.get("subprotocols", []):
            if name.startswith(TOKEN_PREFIX):
                return str(name.removeprefix(TOKEN_PREFIX))
        found = parse_qs(scope["query_string"].decode("latin-1")).get("token")
        return found[0] if found else None
    return None


def _hostname(host: str) -> str:
    try:
        return urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return ""


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name.partition("%")[0])
    except ValueError:
        return False
    return True
