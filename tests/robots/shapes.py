"""A small arm with meshes of known shape: nested, open, with parts that nobody can reach."""

import numpy as np
import trimesh

from contactsense.robots.robot import Inertia, Joint, Link, Robot


def two_links() -> Robot:
    """A base and a bar on a hinge at its end, x along the bar, z the hinge."""
    body = Inertia(1.0, np.zeros(3), np.eye(3))
    hinge = Joint(
        "hinge", np.eye(3), np.array([0.0, 0.0, 0.14]), np.array([0.0, 0.0, 1.0]), (-2.0, 2.0), 1.0, 1.0
    )
    return Robot("two_links", (Link("base", body), Link("bar", body)), (hinge,))


def two_meshes() -> dict[str, trimesh.Trimesh]:
    """A cylinder with a ball inside; a capsule that starts in a disc, with some facets turned inside out."""
    base = trimesh.creation.cylinder(0.05, 0.1, sections=96).apply_translation((0.0, 0.0, 0.05))
    hidden = trimesh.creation.icosphere(3, 0.02).apply_translation((0.0, 0.0, 0.05))
    bar = trimesh.creation.capsule(height=0.2, radius=0.03, count=(64, 64))
    bar.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (0.0, 1.0, 0.0)))
    disc = trimesh.creation.cylinder(0.05, 0.07, sections=96)
    turned = trimesh.util.concatenate([bar, disc])
    turned.faces[::3] = turned.faces[::3, ::-1]
    return {"base": trimesh.util.concatenate([base, hidden]), "bar": turned}


def block(size: tuple[float, float, float], centre: tuple[float, float, float]) -> trimesh.Trimesh:
    """A box of these edge lengths about that place [m]."""
    mesh = trimesh.creation.box(size)
    mesh.apply_translation(centre)
    return mesh


def fork() -> trimesh.Trimesh:
    """A palm, two fingers, and a pin beside the second one."""
    palm = block((0.12, 0.06, 0.05), (0.0, 0.0, 0.025))
    fingers = [block((0.02, 0.03, 0.08), (x, 0.0, 0.1)) for x in (-0.05, 0.05)]
    return trimesh.util.concatenate([palm, *fingers, block((0.005, 0.005, 0.01), (0.063, 0.0, 0.1))])
