"""What a command has printed is kept, so that an interrupted run goes on."""

import hashlib
import shlex
import subprocess
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PRINTED = ROOT / "build" / "results"
"""Folder of what the commands have printed."""


def source_version(folder: Path) -> str:
    """The commit and all changes since, but for those in docs; empty where git does not provide it."""
    commands = ("git rev-parse HEAD", "git diff HEAD -- . :!docs")
    try:
        found = [
            subprocess.run(line.split(), cwd=folder, capture_output=True, text=True) for line in commands
        ]
    except FileNotFoundError:
        return ""
    return "" if any(one.returncode for one in found) else "".join(one.stdout for one in found)


def printed_by(command: str, version: str, folder: Path = PRINTED) -> str:
    """What a command prints: run now, or kept in `folder` from an earlier run of the same version.

    Args:
        command: Run in the repository's folder.
        version: Of `source_version`; an empty one is not kept.
        folder: Made if need be.

    Raises:
        subprocess.CalledProcessError: The command fails.
    """
    key = hashlib.sha256(f"{version}\n{command}".encode()).hexdigest()
    kept = folder / f"{key}.txt"
    if version and kept.exists():
        print(f"{command}: kept", flush=True)
        return kept.read_text(encoding="utf-8")
    print(command, end=": ", flush=True)
    begin = time.monotonic()
    try:
        done = subprocess.run(shlex.split(command), cwd=ROOT, capture_output=True, text=True, check=True)
    except subprocess.CalledProcessError as error:
        print(f"failed\n{error.stderr}", flush=True)
        raise
    print(f"{time.monotonic() - begin:.0f} s", flush=True)
    if version:
        folder.mkdir(parents=True, exist_ok=True)
        unfinished = kept.with_suffix(".part")
        unfinished.write_text(done.stdout, encoding="utf-8")
        unfinished.replace(kept)
    return done.stdout
