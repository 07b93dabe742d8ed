"""The listener that records clips into the folder that the settings name."""

import tempfile
from collections.abc import Callable
from functools import partial

from contactsense.scene import Scene
from contactsense.service.api.settings import Settings, SettingsError
from contactsense.service.live.listener import Listener
from contactsense.service.recordings.writing.clip_listener import ClipListener


def check_folder(settings: Settings) -> None:
    """Check the folder for recordings, and create it. For the start of the service only: while it runs, the
    folder may be away or full, which the listener reports.

    Raises:
        SettingsError: It cannot be written to.
    """
    folder = settings.recording.folder
    if folder is None:
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise SettingsError(
            f"--recordings: {folder}: expected a folder that can be written to, got: {error.strerror}"
        ) from None


def clip_listeners(settings: Settings) -> tuple[Callable[[Scene], Listener], ...]:
    """Factories of the pipeline's listeners, picklable."""
    if settings.recording.folder is None:
        return ()
    return (partial(ClipListener, settings=settings.recording, rate=settings.robot_rate),)
