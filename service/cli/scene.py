"""`contactsense scene`: writes a commented scene file, and shows what a scene says."""

from contactsense.service.cli.lazy import LazyGroup

scene = LazyGroup(
    {
        "new": ("contactsense.service.cli.scene_new:new", "Write a scene, every field with a comment."),
        "show": ("contactsense.service.cli.scene_show:show", "Print what was understood of a scene."),
    },
    name="scene",
    help="Write a commented scene file, or show what a scene says.",
)
