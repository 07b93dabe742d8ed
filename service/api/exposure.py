"""Who can reach the service by its settings: rules of access, and what exposes it by accident."""

import ipaddress

from contactsense.service.api.http.access import AccessRules
from contactsense.service.api.http.token_file import TokenError, read_token
from contactsense.service.api.settings import OptionsError, Settings, SettingsError


def is_loopback(host: str) -> bool:
    """Whether only this computer can reach a service at that address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def access_rules(settings: Settings) -> AccessRules:
    """Return the rules of access.

    Raises:
        SettingsError: The token file cannot be read or contains no token.
    """
    token = settings.token
    if settings.token_file is not None:
        try:
            token = read_token(settings.token_file)
        except TokenError as error:
            raise SettingsError(str(error)) from None
    hosts = (*settings.allowed_hosts, settings.host) if settings.host else settings.allowed_hosts
    return AccessRules(token, hosts, settings.allowed_origins)


def check_exposure(settings: Settings) -> None:
    """Check that the service is not exposed to other computers by accident without a token or without
    TLS.

    Raises:
        OptionsError: The token or TLS is missing; the message states which.
    """
    if (settings.tls_certificate is None) != (settings.tls_key is None):
        raise OptionsError("expected both --tls-certificate and --tls-key, or neither, got one")
    if is_loopback(settings.host):
        return
    if access_rules(settings).token is None:
        raise OptionsError(
            f"--host {settings.host} is reached by other computers: expected a token (CONTACTSENSE_TOKEN or "
            "--token-file), got none"
        )
    if settings.tls_certificate is None and not settings.insecure_no_tls:
        raise OptionsError(
            f"--host {settings.host} is reached by other computers: expected --tls-certificate and "
            "--tls-key, or --insecure-no-tls for a network that you trust, got neither"
        )
