"""Contact between the arm's surface and obstacles: one force per link and obstacle, at the deepest point.

The penetration depth of a convex primitive in an obstacle is the depth of its deepest surface point. In a
half-space this is the support point; in a ball it is the point nearest to the centre. A box with rounded
edges is the Minkowski sum of a core and a ball. If the support point lies over a face of the core, it is the
deepest point. Otherwise the deepest point faces an edge of the core, along which the distance to the
primitive is convex. If the primitive has entered the core across an edge, deeper than the rounding, the face
with the smallest depth is used instead.
"""

from math import sqrt

import numpy as np

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.convex_primitives import Surfaces, project, support
from contactsense.service.mock.physics.bodies import BOX, HALF_SPACE, Obstacles
from contactsense.service.mock.physics.dynamics_kernels import Scratch, cross, turn, turn_back

HALVINGS = 40
"""Bisections along an edge: a metre down to a picometre."""
CLOSE = 1e-9
"""Distance from an edge of a box's core below which a primitive counts as having entered it [m]."""
FAR = 1e9
"""Larger than any distance [m]."""
CREEP = 0.01
"""Sliding speed from which friction has its full magnitude [m/s]; below, it is proportional to the speed."""

Nearest = tuple[float, float, float, float, float, float, float]
"""Depth or distance [m], point [m] and direction."""


@kernel
def deepest_point(
    kind: int, size: np.ndarray, rotation: np.ndarray, origin: np.ndarray, obstacles: Obstacles, i: int
) -> Nearest:
    """Deepest point of one primitive in obstacle i.

    Args:
        kind, size: The primitive.
        rotation, origin: Its pose in the base frame, (3, 3) and (3,) [m].
        obstacles, i: The obstacle.

    Returns:
        Depth [m], not positive if they do not touch; the point (3 floats) and the obstacle's outward normal
        there (3 floats), base frame.
    """
    own, at = obstacles.rotation[i], obstacles.origin[i]
    if obstacles.kind[i] == HALF_SPACE:
        return _behind_plane(
            kind, size, rotation, origin, own[0, 2], own[1, 2], own[2, 2], at[0], at[1], at[2]
        )
    if obstacles.kind[i] == BOX:
        return _in_box(kind, size, rotation, origin, obstacles, i)
    cx, cy, cz = turn_back(rotation, at[0] - origin[0], at[1] - origin[1], at[2] - origin[2])
    gap, px, py, pz, nx, ny, nz = project(kind, size, cx, cy, cz)
    px, py, pz = turn(rotation, px, py, pz)
    nx, ny, nz = turn(rotation, nx, ny, nz)
    return obstacles.radius[i] - gap, px + origin[0], py + origin[1], pz + origin[2], -nx, -ny, -nz


@kernel
def _behind_plane(
    kind: int,
    size: np.ndarray,
    rotation: np.ndarray,
    origin: np.ndarray,
    nx: float,
    ny: float,
    nz: float,
    ax: float,
    ay: float,
    az: float,
) -> Nearest:
    """Deepest point behind the plane through a with normal n."""
    dx, dy, dz = turn_back(rotation, -nx, -ny, -nz)
    px, py, pz = support(kind, size, dx, dy, dz)
    px, py, pz = turn(rotation, px, py, pz)
    px, py, pz = px + origin[0], py + origin[1], pz + origin[2]
    return nx * (ax - px) + ny * (ay - py) + nz * (az - pz), px, py, pz, nx, ny, nz


@kernel
def _in_box(
    kind: int, size: np.ndarray, rotation: np.ndarray, origin: np.ndarray, obstacles: Obstacles, i: int
) -> Nearest:
    """Deepest point in a box with rounded edges."""
    half = obstacles.half[i]
    own, at, reach = obstacles.rotation[i], obstacles.origin[i], obstacles.radius[i]
    least = over = FAR
    face = entered = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for k in range(3):
        for side in range(2):
            sign = 2.0 * side - 1.0
            nx, ny, nz = sign * own[0, k], sign * own[1, k], sign * own[2, k]
            off = half[k] + reach
            ax, ay, az = at[0] + off * nx, at[1] + off * ny, at[2] + off * nz
            depth, px, py, pz, _x, _y, _z = _behind_plane(
                kind, size, rotation, origin, nx, ny, nz, ax, ay, az
            )
            if depth < least:
                least, entered = depth, (px, py, pz, nx, ny, nz)
            foot = turn_back(own, px - at[0], py - at[1], pz - at[2])
            beside, above = foot[(k + 1) % 3], foot[(k + 2) % 3]
            over_face = abs(beside) <= half[(k + 1) % 3] and abs(above) <= half[(k + 2) % 3]
            if over_face and depth <= reach and depth < over:
                over, face = depth, (px, py, pz, nx, ny, nz)
    if over < FAR:
        return over, face[0], face[1], face[2], face[3], face[4], face[5]
    gap, px, py, pz, nx, ny, nz = _nearest_edge(kind, size, rotation, origin, obstacles, i)
    if CLOSE < gap < FAR:
        return reach - gap, px, py, pz, nx, ny, nz
    return least, entered[0], entered[1], entered[2], entered[3], entered[4], entered[5]


@kernel
def _nearest_edge(
    kind: int, size: np.ndarray, rotation: np.ndarray, origin: np.ndarray, obstacles: Obstacles, i: int
) -> Nearest:
    """Distance of a primitive from the nearest edge of a box's core (`FAR` if it is inside), its nearest
    point and the direction from the edge to that point, base frame."""
    half, own, at = obstacles.half[i], obstacles.rotation[i], obstacles.origin[i]
    best = FAR
    bx = by = bz = nx = ny = nz = 0.0
    for k in range(3):
        one, two = (k + 1) % 3, (k + 2) % 3
        # Direction of these edges in the primitive's frame.
        wx, wy, wz = turn_back(rotation, own[0, k], own[1, k], own[2, k])
        for corner in range(4):
            u, v = half[one] * (2.0 * (corner % 2) - 1.0), half[two] * (2.0 * (corner // 2) - 1.0)
            cx = at[0] + u * own[0, one] + v * own[0, two] - origin[0]
            cy = at[1] + u * own[1, one] + v * own[1, two] - origin[1]
            cz = at[2] + u * own[2, one] + v * own[2, two] - origin[2]
            cx, cy, cz = turn_back(rotation, cx, cy, cz)
            low, high = -half[k], half[k]
            for _ in range(HALVINGS):
                s = 0.5 * (low + high)
                gap, px, py, pz, mx, my, mz = project(kind, size, cx + s * wx, cy + s * wy, cz + s * wz)
                if mx * wx + my * wy + mz * wz > 0.0:  # the distance grows with s
                    high = s
                else:
                    low = s
            mx, my, mz = turn(rotation, -mx, -my, -mz)
            # The edge is nearest only if the direction to the primitive points out of both of its faces.
            out_one = mx * own[0, one] + my * own[1, one] + mz * own[2, one]
            out_two = mx * own[0, two] + my * own[1, two] + mz * own[2, two]
            leaves = u * out_one >= -CLOSE and v * out_two >= -CLOSE
            if leaves and gap < best:
                best = gap
                bx, by, bz = turn(rotation, px, py, pz)
                nx, ny, nz = mx, my, mz
    return best, bx + origin[0], by + origin[1], bz + origin[2], nx, ny, nz


@kernel
def _out_of_reach(obstacles: Obstacles, i: int, x: float, y: float, z: float, radius: float) -> bool:
    """Whether a ball around a point (base frame) does not touch obstacle i."""
    own, at = obstacles.rotation[i], obstacles.origin[i]
    dx, dy, dz = x - at[0], y - at[1], z - at[2]
    if obstacles.kind[i] == HALF_SPACE:
        height: float = own[0, 2] * dx + own[1, 2] * dy + own[2, 2] * dz
        return height > radius
    reach: float = radius + obstacles.radius[i]
    if obstacles.kind[i] == BOX:
        dx, dy, dz = turn_back(own, dx, dy, dz)
        half = obstacles.half[i]
        dx, dy, dz = max(abs(dx) - half[0], 0.0), max(abs(dy) - half[1], 0.0), max(abs(dz) - half[2], 0.0)
    square: float = dx * dx + dy * dy + dz * dz
    return square > reach * reach


@kernel
def add_contacts(
    surfaces: Surfaces, obstacles: Obstacles, work: Scratch, pose: np.ndarray, contacts: np.ndarray
) -> None:
    """Add the wrenches of the obstacles on each moving link to the loads, and record the contacts.

    Args:
        surfaces: Primitives of all links.
        obstacles: Obstacles in the cell.
        work: Poses and velocities of the links; `load` is added to.
        pose: Scratch for the pose of a primitive, shape (4, 3).
        contacts: For each obstacle and link: depth [m], point (3) [m], force on the robot (3) [N], base
            frame, shape (M, B, 7); depth 0 without contact.
    """
    for i in range(obstacles.kind.shape[0]):
        for link in range(1, work.origin.shape[0]):
            row = contacts[i, link]
            for k in range(7):
                row[k] = 0.0
            nx = ny = nz = 0.0
            R, o = work.rotation[link], work.origin[link]
            for p in range(surfaces.start[link], surfaces.start[link + 1]):
                centre = surfaces.origin[p]
                x, y, z = turn(R, centre[0], centre[1], centre[2])
                x, y, z = x + o[0], y + o[1], z + o[2]
                if _out_of_reach(obstacles, i, x, y, z, surfaces.radius[p]):
                    continue
                pose[3, 0], pose[3, 1], pose[3, 2] = x, y, z
                own = surfaces.rotation[p]
                for k in range(3):
                    pose[0, k], pose[1, k], pose[2, k] = turn(R, own[0, k], own[1, k], own[2, k])
                depth, px, py, pz, mx, my, mz = deepest_point(
                    surfaces.kind[p], surfaces.size[p], pose[:3], pose[3], obstacles, i
                )
                if depth > row[0]:
                    row[0], row[1], row[2], row[3] = depth, px, py, pz
                    nx, ny, nz = mx, my, mz
            if row[0] > 0.0:
                _push(obstacles, i, link, work, nx, ny, nz, row)


@kernel
def _push(
    obstacles: Obstacles, i: int, link: int, work: Scratch, nx: float, ny: float, nz: float, row: np.ndarray
) -> None:
    """Add the force of obstacle i on a link at a contact point to the loads, and write it to `row`."""
    R, o = work.rotation[link], work.origin[link]
    lx, ly, lz = turn_back(R, row[1] - o[0], row[2] - o[1], row[3] - o[2])
    w, v = work.omega[link], work.velocity[link]
    cx, cy, cz = cross(w[0], w[1], w[2], lx, ly, lz)
    vx, vy, vz = turn(R, v[0] + cx, v[1] + cy, v[2] + cz)
    leaving = vx * nx + vy * ny + vz * nz
    normal = max(0.0, obstacles.stiffness[i] * row[0] - obstacles.damping[i] * leaving)
    tx, ty, tz = vx - leaving * nx, vy - leaving * ny, vz - leaving * nz
    drag = obstacles.friction[i] * normal / max(sqrt(tx * tx + ty * ty + tz * tz), CREEP)
    fx, fy, fz = normal * nx - drag * tx, normal * ny - drag * ty, normal * nz - drag * tz
    row[4], row[5], row[6] = fx, fy, fz
    fx, fy, fz = turn_back(R, fx, fy, fz)
    mx, my, mz = cross(lx, ly, lz, fx, fy, fz)
    load = work.load[link]
    load[0], load[1], load[2] = load[0] + fx, load[1] + fy, load[2] + fz
    load[3], load[4], load[5] = load[3] + mx, load[4] + my, load[5] + mz
