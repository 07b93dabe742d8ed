"""Frames of the contacts that `contactsense analyze` found: one posture each, at the largest force."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pa_parquet
import viser

from contactsense.scene import Scene
from contactsense.service.analysis.contact_table import SCHEMA
from contactsense.service.analysis.summary.other_links import other_links
from contactsense.service.recordings import RecordingError, scene_in
from contactsense.service.viewer.controls import set_value
from contactsense.service.viewer.frame import TRACKS, Forces, Frame
from contactsense.service.viewer.literal_text import literal
from contactsense.types import Contact, Estimate

_NEEDED = [field.name for field in SCHEMA if field.name not in ("silent", "smoothed")]
_BESIDE = (
    "contacts.csv", "report.html", "report.md", "estimates.parquet",
    "fleet.html", "fleet.md", "robots.parquet", "days.parquet",
)  # fmt: skip
"""Files that an analysis writes beside its table."""
_PARTS = "contacts/robot=*/date=*/part-0.parquet"
"""The tables of a dataset."""
_RECORDINGS = (".parquet", ".arrows", ".mcap", ".db3")
"""Endings of the files that a folder may contain as a recording."""
_NO_FORCES = Forces(np.empty(0), np.empty((0, TRACKS)))


def is_analysis(path: Path) -> bool:
    """Whether a file is a table of contacts, as `contactsense analyze` writes it."""
    try:
        names = pa_parquet.read_schema(path).names
    except (OSError, UnicodeEncodeError, pa.ArrowInvalid):  # Arrow opens no name that is not UTF-8
        return False
    return {"peak_time", "point_base_x", "q"}.issubset(names)


def tables_instead(path: Path) -> list[Path]:
    """Tables of contacts in the folder of one or several analyses, or beside a file that one wrote; none for
    any other path."""
    patterns: tuple[str, ...]
    if path.is_file():
        folder = path.parent
        patterns = ("contacts.parquet", _PARTS) if path.name in _BESIDE else ()
    elif (path / "contacts.parquet").is_file():
        folder, patterns = path, ("contacts.parquet",)
    else:
        folder = path
        recordings = (
            each for each in path.glob("*") if each.suffix in _RECORDINGS and each.name not in _BESIDE
        )
        patterns = () if any(recordings) else ("**/contacts.parquet", f"**/{_PARTS}", "**/part-0.parquet")
    found = {file for pattern in patterns for file in folder.glob(pattern)}
    return sorted(file for file in found if is_analysis(file))


class AnalysisSource:
    """The contacts of a table, one of which is shown."""

    title = "Contacts"
    """Label of its controls."""

    def __init__(self, path: Path, scene: Scene | None) -> None:
        """Read the table.

        Args:
            path: `contacts.parquet`.
            scene: The arm; None: that of the recording which the table names.

        Raises:
            RecordingError: The table cannot be used, or there is no scene.
        """
        try:
            self._rows: list[dict[str, Any]] = pa_parquet.read_table(path, columns=_NEEDED).to_pylist()
        except (OSError, pa.ArrowInvalid) as error:
            raise RecordingError(f"{path}: not readable as a table of contacts: {error}") from None
        if not self._rows:
            raise RecordingError(f"{path}: expected at least one contact, got none")
        self.scene = _scene_of(self._rows[0]["recording"], path) if scene is None else scene
        joints = len(self.scene.robot.joints)
        if len(self._rows[0]["q"]) != joints:
            raise RecordingError(
                f"{path}: q: expected {joints} joints, those of {self.scene.robot.name}, got "
                f"{len(self._rows[0]['q'])}"
            )
        clear = self.scene.clear
        self._frames = [Frame(np.array(row["q"]), _estimate(row, clear), _NO_FORCES) for row in self._rows]
        self._shown = 0

    def add_controls(self, gui: viser.GuiApi) -> None:
        """Add the list of contacts."""
        names = [_name(row) for row in self._rows]
        chosen = gui.add_dropdown("Contact", names, initial_value=names[0])
        step = gui.add_button_group("Go to", ("previous", "next"))

        @chosen.on_update
        def _(_: object) -> None:
            self._shown = names.index(chosen.value)

        @step.on_click
        def _(_: object) -> None:
            by = 1 if step.value == "next" else -1
            set_value(chosen, names[(self._shown + by) % len(names)])

    def frame(self) -> Frame:
        """The chosen contact."""
        return self._frames[self._shown]

    def note(self) -> str:
        """The chosen contact, its course, and the other links that it may be on, as Markdown."""
        row = self._rows[self._shown]
        text = (
            f"{Path(row['recording']).name}, from {row['begin']:.2f} s for {row['duration']:.2f} s: largest "
            f"force {row['peak_force']:.1f} N, impulse {row['impulse']:.1f} N s"
        )
        others = other_links(self.scene.link_names, row["link_index"], row["link_probability"])
        if others:
            text = f"{text}; other links, over the whole contact: {', '.join(others)}"
        return literal(text)


def _scene_of(recording: str, table: Path) -> Scene:
    path = Path(recording)
    found = next(
        (each for each in (table.parent / path, path, table.parent / path.name) if each.is_file()), None
    )
    if found is None:
        raise RecordingError(
            f"{table}: its recording {recording} is not here; --scene names the scene{_carried_scene(table)}"
        )
    return scene_in(found)


def _carried_scene(table: Path) -> str:
    """Where the analysis of a dataset kept the scene that the recordings of this table's robot carry."""
    robot = table.absolute().parents[1].name.removeprefix("robot=")
    kept = [up.parent / "scenes" / f"{robot}.yaml" for up in table.parents if up.name == "contacts"]
    return f", such as {kept[0]}" if kept and kept[0].is_file() else ""


def _name(row: dict[str, Any]) -> str:
    return (
        f"{row['contact']}: {row['begin']:.1f} s {row['link'] or 'no single place'} {row['peak_force']:.0f} N"
    )


def _estimate(row: dict[str, Any], clear: float) -> Estimate:
    def vector(name: str) -> np.ndarray:
        return np.array([row[f"{name}_{axis}"] for axis in "xyz"], dtype=float)

    xx, xy, xz, yy, yz, zz = (row[f"covariance_{k}"] for k in ("xx", "xy", "xz", "yy", "yz", "zz"))
    force, point = vector("force_base"), vector("point_base")
    contact = Contact(
        row["link"], row["link_index"], 0, row["probability"], vector("point"), point, vector("normal_base"),
        force, row["torsion"], np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=float),
        row["contact"],
    )  # fmt: skip
    known = row["link_index"] >= 0 and np.isfinite(point).all()
    return Estimate(
        row["peak_time"],
        "contact" if row["probability"] >= clear else "ambiguous",
        (contact,) if known else (),
        np.array(row["link_probability"]),
        np.concatenate((force, np.cross(point, force))),
        np.full((6, 6), np.inf),
        other=max(1.0 - sum(row["link_probability"]), 0.0) if known else 1.0,
    )
