"""WebSocket messages of text that is no text."""

import logging

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from tests.service.api.http.test_access import app, guarded

CUT = "r\u00fc".encode()[:-1]


@pytest.mark.parametrize("frames", [CUT, (b"r", CUT)])
@pytest.mark.parametrize("path", ["/v1/stream", "/v1/track"])
def test_text_that_is_not_utf_8_ends_the_connection(
    path: str, frames: bytes | tuple[bytes, ...], caplog: pytest.LogCaptureFixture
) -> None:
    """As RFC 6455 asks. It is the fault of the client: the service has nothing to log."""
    with guarded(app()) as place:
        logging.getLogger("uvicorn.error").addHandler(caplog.handler)
        try:
            with connect(f"ws://{place}{path}") as client:
                client.send(frames, text=True)
                with pytest.raises(ConnectionClosed) as closed:
                    client.recv(timeout=60.0)
        finally:
            logging.getLogger("uvicorn.error").removeHandler(caplog.handler)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1007
    assert closed.value.rcvd.reason == "expected text in UTF-8, got other bytes"
    assert caplog.text == ""


def test_a_letter_in_two_frames_is_one() -> None:
    with guarded(app()) as place, connect(f"ws://{place}/v1/track") as client:
        client.send((CUT, "\u00fc".encode()[-1:]), text=True)
        assert "expected one object in JSON" in str(client.recv(timeout=60.0))
