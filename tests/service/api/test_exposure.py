"""Who can reach the service by its settings."""

from pathlib import Path

import pytest

from contactsense.service.api.exposure import access_rules, check_exposure
from contactsense.service.api.settings import Settings, SettingsError

TOKEN = "a token of many characters"


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ({"host": "0.0.0.0"}, "expected a token"),
        ({"host": "0.0.0.0", "token": TOKEN}, "--insecure-no-tls"),
        ({"host": "192.0.2.1", "token": TOKEN, "tls_key": "k"}, "both --tls-certificate and --tls-key"),
    ],
)
def test_other_computers_only_with_token_and_tls(settings: dict[str, object], complaint: str) -> None:
    with pytest.raises(SettingsError, match=complaint):
        check_exposure(Settings.checked(settings))


def test_other_computers_with_all_that_is_needed(tmp_path: Path) -> None:
    check_exposure(Settings.checked({"host": "0.0.0.0", "token": TOKEN, "insecure_no_tls": True}))
    check_exposure(Settings.checked({"host": "::1"}))
    path = tmp_path / "token"
    path.write_text(f"{TOKEN}\n")
    settings = Settings.checked(
        {"host": "0.0.0.0", "token_file": path, "tls_certificate": "c", "tls_key": "k"}
    )
    check_exposure(settings)
    assert access_rules(settings).token == TOKEN
    path.write_text("short")
    with pytest.raises(SettingsError, match="at least 16 characters"):
        access_rules(settings)
    path.unlink()
    with pytest.raises(SettingsError, match="cannot be read"):
        access_rules(settings)
