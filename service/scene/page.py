"""The page docs/scene.md: `python -m contactsense.service.scene.page > docs/scene.md` writes it again."""

from pydantic import BaseModel

from contactsense.service.scene.commented_yaml import commented_yaml
from contactsense.service.scene.example import EXAMPLE
from contactsense.service.scene.fields import TABLES, describe_fields

_BEGINNING = (
    "# The scene file",
    "All fields of a scene, with a complete example: for everyone who describes a cell. A scene describes "
    "one arm in its cell; [cell.md](cell.md) explains mounting, frames and torque signals.",
    "`contactsense scene new scene.yaml` asks for what is needed and writes such a file. `contactsense "
    "scene show scene.yaml` prints what was understood, and with `--picture scene.png` draws it. In "
    'Python the same fields are arguments: `Scene(robot="ur5e", mounting="ceiling")`.',
    "This page is made from the code: `python -m contactsense.service.scene.page > docs/scene.md`.",
    "## A complete example",
    "A UR10e with a gripper stands beside a table, on a pedestal that is tilted by 30 degrees. The "
    "force/torque sensor below its base is turned by 45 degrees, reads the push of the sensor on the arm, "
    "and carries an adapter plate. Joint torques come from motor currents. The numbers of sensor, "
    "friction, gripper and bodies are examples: replace them by yours. `contactsense decompose` makes the "
    "primitives of tool and bodies from meshes "
    "([geometry.md](geometry.md#make-the-surface-of-a-tool-or-a-body)).",
    f"```yaml\n{commented_yaml(EXAMPLE)}```",
    "## All fields",
    "Fields without default are required. Three numbers are x, y, z; angles are roll, pitch, yaw about fixed "
    "axes. Where a field of the joints takes one number for all, it also takes one per joint. Relative "
    "paths are relative to the folder of the scene file or, if no such file is there, to the working folder.",
)
"""Paragraphs before the tables."""
_DEFAULTS = {"required": "required", "{}": "the defaults below"}


def scene_page() -> str:
    """The text of docs/scene.md."""
    tables = (part for heading, model in TABLES.items() for part in (f"### {heading}", _table(model)))
    return "\n\n".join((*_BEGINNING, *tables)) + "\n"


def _table(model: type[BaseModel]) -> str:
    rows = ["| field | unit | default | meaning |", "| --- | --- | --- | --- |"]
    for field in describe_fields(model):
        default = _DEFAULTS.get(field.default, f"`{field.default}`")
        meaning = field.meaning.replace("|", "\\|")
        rows.append(f"| `{field.name}` | {field.unit} | {default} | {meaning} |")
    return "\n".join(rows)


if __name__ == "__main__":
    print(scene_page(), end="")
