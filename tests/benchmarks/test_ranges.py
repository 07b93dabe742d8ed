"""Numbers that a benchmark cannot use are refused before it begins."""

import pytest
from click.testing import CliRunner

from contactsense.service.cli.main import cli


@pytest.mark.parametrize(
    ("arguments", "option"),
    [
        (("hold", "--runs", "0"), "--runs"),
        (("coverage", "--runs", "0"), "--runs"),
        (("coverage", "--rate", "0"), "--rate"),
        (("map", "--draws", "0"), "--draws"),
        (("map", "--every", "0"), "--every"),
        (("map", "--friction", "-1"), "--friction"),
        (("cells", "scene.yaml", "--force", "nan"), "--force"),
        (("cells", "scene.yaml", "--contacts", "0"), "--contacts"),
        (("setup", "--draws", "-1"), "--draws"),
        (("pushes", "--runs", "0"), "--runs"),
        (("several", "--force", "-5"), "--force"),
    ],
)
def test_numbers_out_of_range_are_refused(arguments: tuple[str, ...], option: str) -> None:
    result = CliRunner().invoke(cli, ["bench", *arguments])
    assert result.exit_code == 2, result.output
    assert f"Invalid value for '{option}'" in result.output
