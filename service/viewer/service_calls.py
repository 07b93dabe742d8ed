"""Requests of commands to a service over HTTP, with errors of one line."""

import errno
import http.client
import json
import ssl
import urllib.error
import urllib.request
from typing import Any, TypeVar
from urllib.parse import urlsplit

from pydantic import BaseModel, ValidationError

from contactsense.scene import Scene, SceneError
from contactsense.service.api.clips import RecordingOut
from contactsense.service.api.messages import HealthOut, SceneOut
from contactsense.service.reactions.health import ReactionsOut

TIMEOUT = 5.0
"""Longest time for an answer [s]."""
FOREIGN = "this is not a contactsense service, or one of another version"
_PROXY = (502, 503, 504)
"""Statuses with which a proxy says that its service does not answer, or a service that it is busy."""
Answer = TypeVar("Answer", bound=BaseModel)


class LiveError(RuntimeError):
    """The service cannot be used; the message is one line for a person."""


class AwayError(LiveError):
    """No service answers there, as before it has been started."""


class UrlError(LiveError):
    """What was given is no URL, whatever service runs."""


class ServiceCalls:
    """The requests that `contactsense view` and `contactsense record` make."""

    def __init__(self, url: str, token: str | None = None) -> None:
        """Nothing is sent yet.

        Args:
            url: Of the service, for example http://127.0.0.1:8000.
            token: Its token, where it has one.

        Raises:
            UrlError: This is none.
        """
        try:
            parts = urlsplit(url)
            usable = parts.scheme in ("http", "https") and parts.hostname and (parts.port or True)
            usable = usable and not (parts.query or parts.fragment or any(char.isspace() for char in url))
        except ValueError:
            usable = False
        if not usable:
            raise UrlError(f"--url: expected one such as http://127.0.0.1:8000, got {url!r}")
        self.url = url.rstrip("/")
        """The service's URL."""
        self.headers = {} if token is None else {"Authorization": f"Bearer {token}"}
        """Headers of each request."""

    def scene(self) -> Scene:
        """The service's scene.

        Raises:
            LiveError: It does not answer, or names files that are not on this computer.
        """
        try:
            return Scene(**self.scene_fields())
        except (SceneError, OSError) as error:
            raise LiveError(
                f"{self.url}: its scene cannot be used here: {error}; --scene names a copy of it"
            ) from None

    def scene_fields(self) -> dict[str, Any]:
        """The service's scene as its YAML file would have it.

        Raises:
            LiveError: It does not answer.
        """
        return self._get(SceneOut, "/v1/scene").scene

    def health(self) -> HealthOut:
        """State of the service.

        Raises:
            LiveError: It does not answer.
        """
        return self._get(HealthOut, "/v1/health")

    def reactions(self) -> ReactionsOut:
        """Latched collisions.

        Raises:
            LiveError: The service does not answer.
        """
        return self._get(ReactionsOut, "/v1/reactions")

    def acknowledge(self) -> None:
        """Acknowledge all latched collisions.

        Raises:
            LiveError: The service refuses, with its reason.
        """
        self._read("/v1/reactions/acknowledge", b"{}")

    def recording(self, on: bool | None = None) -> RecordingOut:
        """State of the recording on the service's computer.

        Args:
            on: Start or end it first; None: leave it as it is.

        Raises:
            LiveError: The service does not answer, or refuses, with its reason.
        """
        body = None if on is None else json.dumps({"on": on}).encode()
        return self._get(RecordingOut, "/v1/recording", body)

    def _get(self, form: type[Answer], path: str, body: bytes | None = None) -> Answer:
        """The answer in the form that a service of this version gives it."""
        try:
            return form.model_validate_json(self._read(path, body))
        except ValidationError:
            raise LiveError(f"{self.url}{path}: {FOREIGN}") from None

    def _read(self, path: str, body: bytes | None = None) -> bytes:
        request = urllib.request.Request(f"{self.url}{path}", body, self.headers)
        if body is not None:
            request.add_header("Content-Type", "application/json")
        try:
            with urllib.request.urlopen(request, timeout=TIMEOUT) as answer:
                return bytes(answer.read())
        except urllib.error.HTTPError as error:
            hint = "; --token-file names the file with its token" if error.code == 401 else ""
            kind = AwayError if error.code in _PROXY else LiveError
            raise kind(f"{self.url}{path}: {error.code} {_reason(error)}{hint}") from None
        except (OSError, http.client.HTTPException) as error:
            reason = getattr(error, "reason", error)
            kind = AwayError if _is_away(reason) else LiveError
            raise kind(f"{self.url} cannot be reached: {in_words(reason)}") from None


def in_words(reason: object) -> str:
    """Why a service cannot be reached, as a person would say it, and what may help."""
    if isinstance(reason, ssl.SSLCertVerificationError):
        return (
            f"{reason.verify_message}; the environment variable SSL_CERT_FILE names a file with the "
            "certificate to trust"
        )
    if isinstance(reason, http.client.RemoteDisconnected):
        return f"{reason}; if it serves TLS, the URL begins with https"
    if isinstance(reason, http.client.BadStatusLine):
        return "what answers there does not speak HTTP"
    if isinstance(reason, ssl.SSLError) and reason.reason == "WRONG_VERSION_NUMBER":
        return "what answers there does not serve TLS; if it is the service, the URL begins with http"
    return str(getattr(reason, "strerror", None) or reason)


def _is_away(reason: object) -> bool:
    """Whether the address is right as far as one can tell, and a service may come."""
    if isinstance(reason, ConnectionRefusedError | TimeoutError):
        return True
    return isinstance(reason, OSError) and reason.errno in (errno.EHOSTUNREACH, errno.ENETUNREACH)


def _reason(error: urllib.error.HTTPError) -> str:
    try:
        return "; ".join(str(each["reason"]) for each in json.loads(error.read())["errors"])
    except (ValueError, KeyError, TypeError, OSError):
        return str(error.reason) if error.code in _PROXY else f"{error.reason}: {FOREIGN}"
