"""`contactsense scene`: writes a commented scene file, and shows what a scene says."""

from contactsense.service.cli.lazy import LazyGroup

scene = LazyGroup(
    {
        "new": "contactsense.service.cli.scene_new:new",
        "show": "contactsense.service.cli.scene_show:show",
    },
    name="scene",
    help="Write a commented scene file, or show what a scene says.",
)
