"""Messages between the service and a process that steps through a controller's samples: bytes in, messages
out."""

import struct

from contactsense.service.controllers.sample_message import MAX_SCENE, MessageError

_HEAD = struct.Struct("<?I")


def frame(message: bytes, binary: bool) -> bytes:
    """One message with its head: whether it is MessagePack, and its length."""
    return _HEAD.pack(binary, len(message)) + message


class Unframer:
    """Cuts a stream of bytes into messages."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def feed(self, chunk: bytes) -> list[tuple[bytes, bool]]:
        """Messages that are complete with these bytes, each with whether it is MessagePack.

        Raises:
            MessageError: A message is longer than any may be; the stream cannot be read on.
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
