"""Joint angles of a command line."""

import numpy as np
import pytest

from contactsense.service.cli.options.joint_angles import joint_angles


@pytest.mark.parametrize(
    ("text", "warning"),
    [
        (
            "0,-1.5708,1.5708",
            "warning: --posture: degrees are expected; if 0,-1.5708,1.5708 is in rad: 0,-90,90\n",
        ),
        ("0,-90,0.5", ""),
        ("0,0,1", ""),
    ],
)
def test_angles_that_look_like_radians_are_asked_about(
    text: str, warning: str, capsys: pytest.CaptureFixture[str]
) -> None:
    np.testing.assert_allclose(joint_angles("--posture", text, 3), np.radians(np.fromstring(text, sep=",")))
    assert capsys.readouterr().err == warning
