"""A small client of the service: reads its health and its stream of estimates."""

import json
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack

from websockets.exceptions import ConnectionClosed, WebSocketException
from websockets.sync.client import connect
from websockets.sync.connection import Connection

from contactsense.service.api.messages import EstimateOut, HealthOut, LostOut

SILENCE = 15.0
"""Longest time without an estimate [s]."""


class ClientError(RuntimeError):
    """The service does not answer as expected."""


class Client:
    """Client of a running service; subscribes to its stream at once, so that nothing is missed."""

    def __init__(self, url: str) -> None:
        """Connect to the service at `url`, for example http://127.0.0.1:8000.

        Raises:
            ClientError: No service answers there.
        """
        self.url = url
        """URL of the service."""
        self.stream_url = url.replace("http", "ws", 1) + "/v1/stream"
        """URL of its stream."""
        try:
            self._open = ExitStack()
            self._stream: Connection = self._open.enter_context(
                connect(self.stream_url, compression=None, close_timeout=0.5)
            )
        except (OSError, WebSocketException) as error:
            raise ClientError(f"{self.stream_url} cannot be reached: {error}") from None

    def health(self) -> HealthOut:
        """State of the service.

        Raises:
            ClientError: The service does not answer.
        """
        try:
            with urllib.request.urlopen(f"{self.url}/v1/health", timeout=SILENCE) as answer:
                return HealthOut.model_validate_json(answer.read())
        except (OSError, urllib.error.URLError) as error:
            raise ClientError(f"{self.url}/v1/health: {error}") from None

    def receive(self) -> str | bytes:
        """The next message of the stream.

        Raises:
            ClientError: No message arrived for too long, with the reason that the service gives; or the
                service has ended.
        """
        try:
            return self._stream.recv(timeout=SILENCE)
        except TimeoutError:
            raise ClientError(f"no estimate for {SILENCE:g} s: {self.health().message}") from None
        except ConnectionClosed as error:
            raise ClientError(f"the service has gone: {error}") from None

    def stream(self) -> Iterator[EstimateOut | int]:
        """Yield estimates as they arrive, and, as plain integers, the number of estimates that were lost.

        Raises:
            ClientError: As for `receive`.
        """
        while True:
            content = json.loads(self.receive())
            yield LostOut(**content).lost if "lost" in content else EstimateOut.model_validate(content)

    def close(self) -> None:
        """Disconnect."""
        self._open.close()

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
