"""Framing of messages between the service and a controller's process: bytes in, messages out."""

import struct

from contactsense.service.controllers.sample_message import MAX_SCENE, MessageError

_HEAD = struct.Struct("<?I")


def frame(message: bytes, binary: bool) -> bytes:
    """Add the header to a message: whether it is MessagePack, and its length."""
    return _HEAD.pack(binary, len(message)) + message


class Unframer:
    """Splits a stream of bytes into messages."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def feed(self, chunk: bytes) -> list[tuple[bytes, bool]]:
        """Add bytes; returns the messages that are now complete, each with a flag for MessagePack.

        Raises:
            MessageError: A message exceeds the largest size; the rest of the stream cannot be read.
        """
        self._rest += chunk
        messages = []
        while len(self._rest) >= _HEAD.size:
            binary, size = _HEAD.unpack_from(self._rest)
            if size > MAX_SCENE:
                raise MessageError("", f"expected at most {MAX_SCENE} bytes, got {size}")
            end = _HEAD.size + size
            if len(self._rest) < end:
                break
            messages.append((bytes(self._rest[_HEAD.size : end]), binary))
            del self._rest[:end]
        return messages
