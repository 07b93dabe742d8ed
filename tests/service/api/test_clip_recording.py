"""The folder for recordings that the settings name."""

from pathlib import Path

import pytest

from contactsense.service.api.clip_recording import check_folder, clip_listeners
from contactsense.service.api.settings import Settings, SettingsError


def test_a_folder_that_cannot_be_written_to_is_refused_at_the_start(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        settings = Settings.model_validate({"recording": {"folder": folder}})
        with pytest.raises(
            SettingsError, match=r"--recordings: .*file.*: expected a folder that can be writ"
        ):
            check_folder(settings)
    settings = Settings.model_validate({"recording": {"folder": tmp_path / "new"}})
    check_folder(settings)
    assert len(clip_listeners(settings)) == 1
    assert list((tmp_path / "new").iterdir()) == []
