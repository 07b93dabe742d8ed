"""The log of the first compilation: one line for each tenth that is done."""

import logging

import pytest

from contactsense.robots.jit.compilation import CompilationProgress
from contactsense.service.cli.serve import _LogLines


def test_the_beginning_is_left_to_the_status(caplog: pytest.LogCaptureFixture) -> None:
    """The service logs `starting: compiling kernels` itself."""
    caplog.set_level(logging.INFO, "contactsense")
    lines = _LogLines()
    for share in (0.0, 0.001, 0.09, 0.12, 0.15, 0.31, 1.0):
        lines.update(CompilationProgress(share, 60.0 * (1.0 - share)))
    assert [line.split(",")[0] for line in caplog.messages] == [
        "compiling kernels: 12 %",
        "compiling kernels: 31 %",
        "compiling kernels: 100 %",
    ]
