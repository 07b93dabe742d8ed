"""Errors that no route expects."""

import pytest
from fastapi import FastAPI

from contactsense.service.api.http import errors
from tests.service import http
from tests.service.serving import serving


def test_a_fault_of_the_program_has_the_form_of_all_errors(capsys: pytest.CaptureFixture[str]) -> None:
    app = FastAPI()
    errors.install(app)

    @app.get("/fault")
    async def _() -> None:
        raise ZeroDivisionError("a secret")

    with serving(app) as place:
        answer = http.get(f"http://{place}/fault")
    reason = "ZeroDivisionError in the service, a fault of the program; the log of the service says more"
    assert (answer.status_code, answer.json()) == (500, {"errors": [{"field": "", "reason": reason}]})
    assert "a secret" in capsys.readouterr().err
