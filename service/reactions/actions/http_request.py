"""One HTTP request, with a limit for all of it."""

import http.client
import urllib.error
import urllib.request
from collections.abc import Mapping
from typing import Any

from contactsense.service.reactions.actions.base import ActionError
from contactsense.service.reactions.actions.time_limit import TimeLimit


def request(
    url: str, method: str, body: bytes, headers: Mapping[str, str], timeout: float, *, direct: bool = False
) -> int:
    """Send a request; returns the status of the answer, also of a refusal or a redirection.

    Args:
        url: Address.
        method: Such as `POST`.
        body: What is sent.
        headers: Header fields.
        timeout: Time limit [s].
        direct: Whether to use no proxy, though the environment names one, as in `http_proxy`.

    Raises:
        ActionError: There is no answer; the message says why, without the address.
    """
    opened: list[http.client.HTTPConnection] = []
    proxies = [urllib.request.ProxyHandler({})] if direct else []
    with TimeLimit(timeout, lambda: [connection.sock for connection in opened]) as limit:
        handlers = (_HTTP(opened, limit), _HTTPS(opened, limit))
        opener = urllib.request.build_opener(_NoRedirect, *handlers, *proxies)
        late = f"no answer within {timeout:g} s"
        try:
            status = _status(opener, urllib.request.Request(url, body, dict(headers), method=method), timeout)
        # A ValueError: the URL cannot be requested as it is, such as one with letters that are not ASCII.
        except (OSError, http.client.HTTPException, ValueError) as error:
            raise ActionError(late if limit.expired else no_answer(error, timeout)) from None
        if limit.expired:  # header fields that are cut off count as complete
            raise ActionError(late)
        return status


def _status(opener: urllib.request.OpenerDirector, outgoing: urllib.request.Request, timeout: float) -> int:
    try:
        with opener.open(outgoing, timeout=timeout) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        with error:
            return error.code


def no_answer(error: Exception, timeout: float) -> str:
    """Why an HTTP request has no answer, in the words of
    `contactsense.service.reactions.actions.base.connection`."""
    cause = error.reason if isinstance(error, urllib.error.URLError) else error
    if isinstance(cause, TimeoutError):
        return f"no answer within {timeout:g} s"
    if isinstance(cause, OSError):
        return cause.strerror or str(cause)
    return f"expected HTTP, got {cause}" if isinstance(cause, http.client.BadStatusLine) else str(cause)


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    def redirect_request(self, *_: Any, **__: Any) -> None:
        return None  # a redirection does not count as success


class _Connection(http.client.HTTPConnection):
    """Sends nothing after the time limit."""

    limit: TimeLimit

    def connect(self) -> None:
        super().connect()
        if self.limit.expired:  # in looking up the name: nobody expects anything to be sent by now
            raise TimeoutError


class _SecureConnection(_Connection, http.client.HTTPSConnection):
    pass


class _Noting(urllib.request.AbstractHTTPHandler):
    """Notes the connections that it opens."""

    kind: type[_Connection]

    def __init__(self, opened: list[http.client.HTTPConnection], limit: TimeLimit) -> None:
        super().__init__()
        self._opened, self._limit = opened, limit

    def do_open(self, http_class: Any, req: Any, **options: Any) -> Any:
        return super().do_open(self._open, req, **options)

    def _open(self, *args: Any, **options: Any) -> _Connection:
        connection = self.kind(*args, **options)
        connection.limit = self._limit
        self._opened.append(connection)
        return connection


class _HTTP(_Noting, urllib.request.HTTPHandler):
    kind = _Connection


class _HTTPS(_Noting, urllib.request.HTTPSHandler):
    kind = _SecureConnection
