"""A webhook, signed as in Standard Webhooks (https://www.standardwebhooks.com, specification 1.0.0)."""

import base64
import hashlib
import hmac
import re
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from contactsense.service.reactions.actions.base import ActionError, ActionSettings

PREFIX = "whsec_"


class WebhookAction(ActionSettings):
    """Where to post. A failed delivery is stored in the journal and retried for a day."""

    type: Literal["webhook"]
    """Kind of the action."""
    url: str
    """Address to post to."""
    secret: str | None = None
    """Signing secret: `whsec_` followed by 24 to 64 bytes in base64. Exactly one of it and `secret_file`
    is needed."""
    secret_file: Path | None = None
    """File that contains the secret, instead of `secret`; relative to the folder of the rules."""
    timeout: Annotated[float, Field(gt=0.0, le=60.0)] = 20.0
    """Time limit of one attempt [s]."""

    @field_validator("url")
    @classmethod
    def _can_be_posted_to(cls, url: str) -> str:
        if re.fullmatch(r"https?://[^\s/]+\S*", url) is None:
            raise ValueError(f"expected an address such as https://example.com/contacts, got {url!r:.80}")
        return url

    @field_validator("secret_file")
    @classmethod
    def _beside_the_rules(cls, file: Path | None, info: ValidationInfo) -> Path | None:
        # A service that the computer starts works in another folder than whoever tries the rules.
        folder = (info.context or {}).get("folder", Path())
        return None if file is None else folder / file

    @model_validator(mode="after")
    def _has_a_secret(self) -> Self:
        if (self.secret is None) == (self.secret_file is None):
            got = "neither" if self.secret is None else "both"
            raise ValueError(f"expected either secret or secret_file, got {got}")
        if self.secret is not None:
            decode_secret(self.secret)
        return self

    def key(self) -> bytes:
        """Return the signing key.

        Raises:
            ActionError: The file cannot be read or contains no secret.
        """
        try:
            return decode_secret(self.secret or Path(self.secret_file or "").read_text().strip())
        except OSError as error:
            raise ActionError(f"secret_file: {self.secret_file}: {error.strerror}") from None
        except ValueError as error:
            raise ActionError(f"secret_file: {self.secret_file}: {error}") from None

    def describe(self) -> str:
        """Return a short description of the action."""
        return f"post to {self.url}, with retries"

    def missing(self) -> str:
        """See `ActionSettings.missing`."""
        try:
            self.key()
        except ActionError as error:
            return str(error)
        return ""


def decode_secret(secret: str) -> bytes:
    """Decode the key from a secret of the form `whsec_<base64>`.

    Raises:
        ValueError: The secret does not have this form; the message does not repeat it.
    """
    try:
        key = base64.b64decode(secret.removeprefix(PREFIX), validate=True)
    except ValueError:  # a character that base64 does not have, or a length
        key = b""
    if not secret.startswith(PREFIX) or not 24 <= len(key) <= 64:
        raise ValueError(f"secret: expected {PREFIX} and 24 to 64 bytes in base64, got something else")
    return key


def sign(key: bytes, webhook_id: str, timestamp: int, body: bytes) -> str:
    """Return the value of the header `webhook-signature`."""
    signed = f"{webhook_id}.{timestamp}.".encode() + body
    return "v1," + base64.b64encode(hmac.new(key, signed, hashlib.sha256).digest()).decode()
