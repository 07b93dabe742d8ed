"""The systemd unit, its drop-in and the container file: systemd understands them, their settings exist."""

import re
import shutil
import subprocess
from fnmatch import fnmatch
from pathlib import Path

import pytest

from contactsense.service.api.settings import Settings
from contactsense.service.api.variables import GROUPED, PREFIX

ROOT = Path(__file__).parents[2]
DEPLOY = ROOT / "deploy"
UNIT = DEPLOY / "contactsense.service"
SECRETS = DEPLOY / "contactsense.service.d" / "secrets.conf"
CONTAINER = DEPLOY / "Containerfile"


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd is not installed")
def test_systemd_understands_unit_and_drop_in(tmp_path: Path) -> None:
    unit = UNIT.read_text().replace("/opt/contactsense/bin/contactsense", "/bin/true")
    (tmp_path / UNIT.name).write_text(unit)
    shutil.copytree(SECRETS.parent, tmp_path / SECRETS.parent.name)
    command = ["systemd-analyze", "verify", "--man=no", str(tmp_path / UNIT.name)]
    found = subprocess.run(command, capture_output=True, text=True, timeout=60.0)
    # Units of this computer are read, too.
    assert [line for line in found.stderr.splitlines() if str(tmp_path) in line] == []
    assert found.returncode == 0


@pytest.mark.parametrize("file", [UNIT, SECRETS, CONTAINER], ids=lambda file: file.name)
def test_variables_are_settings(file: Path) -> None:
    known = {name.upper() for name in (*Settings.model_fields, *(name for name, _, _ in GROUPED))}
    named = set(re.findall(rf"\b{PREFIX}(\w+)=", file.read_text()))
    assert named
    assert named <= known


def test_each_secret_that_is_used_is_handed_over() -> None:
    """The dynamic user of the unit cannot read files of root."""
    assert "DynamicUser=yes" in UNIT.read_text()
    text = SECRETS.read_text()
    handed = re.findall(r"^LoadCredential=([\w.]+):/", text, re.MULTILINE)
    used = re.findall(r"^Environment=\w+=%d/([\w.]+)$", text, re.MULTILINE)
    assert sorted(handed) == sorted(used)
    assert len(re.findall(r"^Environment=", text, re.MULTILINE)) == len(used)


def test_compiled_kernels_survive_a_container() -> None:
    text = CONTAINER.read_text()
    (folder,) = re.findall(r"NUMBA_CACHE_DIR=(\S+)", text)
    (volumes,) = re.findall(r"^VOLUME (.*)$", text, re.MULTILINE)
    assert folder in volumes.split()


def test_the_image_keeps_its_health_check() -> None:
    """podman builds images of the OCI format by default, which has none."""
    text = CONTAINER.read_text()
    assert "HEALTHCHECK" in text
    commands = re.findall(r"^# (podman build .*)$", text, re.MULTILINE)
    assert commands
    assert all("--format docker" in command for command in commands)


@pytest.mark.parametrize(
    ("path", "left_out"),
    [
        (".git", True), (".venv", True), ("build", True), ("dist", True), (".mypy_cache", True),
        ("key.pem", True), ("token", True), ("contactsense.egg-info", True), ("pyproject.toml", False),
        ("constraints.txt", False), ("README.md", False), ("LICENSE", False), ("contactsense", False),
        ("robots", False), ("kinematics", False), ("service", False), ("benchmarks", False),
    ],
)  # fmt: skip
def test_the_image_is_built_from_the_sources_alone(path: str, left_out: bool) -> None:
    lines = (ROOT / ".dockerignore").read_text().splitlines()
    patterns = [line.removeprefix("**/") for line in lines if line and not line.startswith("#")]
    assert any(fnmatch(path, pattern) for pattern in patterns) == left_out
