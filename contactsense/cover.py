"""Places that cannot be touched: inside another body of the arm, without room above them, or under the
base."""

import math

from contactsense.energy import TAIL, tangents
from robots.compiled import fused_kernel, inlined_fused_kernel
from robots.surface import out_of_reach, project

RINGS = ((0.91195, 0.71109 / 6), (2.14213, 0.27852 / 6), (3.54680, 0.010389 / 6))
"""Radii, in standard deviations, and weights of the points that stand for a normal distribution on a plane:
six on each of three rings (Gauss-Laguerre in half the squared radius)."""
HEXAGON = tuple((math.cos(math.pi / 3.0 * k), math.sin(math.pi / 3.0 * k)) for k in range(6))
"""Where on a ring the points are."""
WIDEST = 3.9
"""Standard deviations within which a place must be clear for no look around it to be needed: `BENT` times the
widest ring."""
BENT = 1.1
"""How much farther away than a ring is wide other primitives must be for it to be clear, as surfaces are
bent."""
SHARPNESS = 4.0
"""How much smaller than the surface's offset a lack of room may be to be forgiven."""
WHOLE = 0.98
"""Exposed share above which a place is left as it is."""


@inlined_fused_kernel
def clearance(surfaces, found, own, x, y, z, enough):  # type: ignore[no-untyped-def]
    """Distance of a point from the nearest other primitive of the same link or a neighbour [m], negative
    inside.

    Args:
        surfaces, found: Primitives, and where they are.
        own: Primitive that does not count.
        x, y, z: The point, base frame [m].
        enough: More than this need not be told apart [m].
    """
    link = surfaces.link[own]
    first = surfaces.start[max(link - 1, 0)]
    last = surfaces.start[min(link + 2, surfaces.start.shape[0] - 1)]
    least = enough
    for p in range(first, last):
        o = found.origin[p]
        dx, dy, dz = x - o[0], y - o[1], z - o[2]
        reach = surfaces.radius[p] + least
        if p == own or reach <= 0.0 or dx * dx + dy * dy + dz * dz > reach * reach:
            continue
        R = found.rotation[p]
        kind, size = surfaces.kind[p], surfaces.size[p]
        ax = R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz
        ay = R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz
        az = R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz
        if not out_of_reach(kind, size, ax, ay, az, least):
            least = min(least, project(kind, size, ax, ay, az)[0])
    return least


@fused_kernel
def exposed(depth, prior):  # type: ignore[no-untyped-def]
    """How far a place counts as one that can be touched: 1 with room above it; as the surfaces may be off, a
    little too little room still counts. `depth`: clearance above it, negative without room [m]."""
    if depth >= 0.0:
        return 1.0
    lack = SHARPNESS * depth / prior.offset
    return (1.0 + lack * lack / TAIL) ** (-0.5 * (TAIL + 1.0))


@fused_kernel
def room_above(surfaces, found, row, prior):  # type: ignore[no-untyped-def]
    """Clearance above an explanation's place, negative where that is covered, told up to `WIDEST` times the
    longest standard deviation; that; and the covariance along `tangents` (three numbers)."""
    c, n = found.point[row], found.normal[row]
    C = found.covariance[row]
    t1x, t1y, t1z, t2x, t2y, t2z = tangents(n[0], n[1], n[2])
    c1x = C[0, 0] * t1x + C[0, 1] * t1y + C[0, 2] * t1z
    c1y = C[1, 0] * t1x + C[1, 1] * t1y + C[1, 2] * t1z
    c1z = C[2, 0] * t1x + C[2, 1] * t1y + C[2, 2] * t1z
    v11 = t1x * c1x + t1y * c1y + t1z * c1z
    v12 = t2x * c1x + t2y * c1y + t2z * c1z
    v22 = (
        t2x * (C[0, 0] * t2x + C[0, 1] * t2y + C[0, 2] * t2z)
        + t2y * (C[1, 0] * t2x + C[1, 1] * t2y + C[1, 2] * t2z)
        + t2z * (C[2, 0] * t2x + C[2, 1] * t2y + C[2, 2] * t2z)
    )
    longest = math.sqrt(max(0.5 * (v11 + v22) + math.sqrt(0.25 * (v11 - v22) ** 2 + v12 * v12), 0.0))
    room = prior.room
    x, y, z = c[0] + room * n[0], c[1] + room * n[1], c[2] + room * n[2]
    near = clearance(surfaces, found, found.primitive[row], x, y, z, WIDEST * longest)
    return near, longest, v11, v12, v22


@fused_kernel
def cover_place(surfaces, found, row, prior, least):  # type: ignore[no-untyped-def]
    """Take into account which part of an explanation's neighbourhood can be touched: its score is lowered by
    the log of that share, its place and covariance become those of the share. Where nothing above the score
    `least` can come of it, the score becomes -infinity at once.

    Returns:
        Whether all of it is clear, which leaves the explanation as it is.
    """
    near, longest, v11, v12, v22 = room_above(surfaces, found, row, prior)
    if near >= WIDEST * longest:
        return True
    if found.score[row] + math.log(exposed(near + WIDEST * longest, prior)) < least:
        found.score[row] = -math.inf
        return False
    p, room = found.primitive[row], prior.room
    c, n = found.point[row], found.normal[row]
    C = found.covariance[row]
    t1x, t1y, t1z, t2x, t2y, t2z = tangents(n[0], n[1], n[2])
    # Root of the covariance in the tangent plane: v = (a u1, b u1 + d u2).
    a = math.sqrt(max(v11, 1e-18))
    b = v12 / a
    d = math.sqrt(max(v22 - b * b, 0.0))
    share, mx, my, mz = 0.0, 0.0, 0.0, 0.0
    xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    R, o = found.rotation[p], found.origin[p]
    for radius, weight in RINGS:
        for k in range(6):
            u1, u2 = radius * HEXAGON[k][0], radius * HEXAGON[k][1]
            v1, v2 = a * u1, b * u1 + d * u2
            ex, ey, ez = v1 * t1x + v2 * t2x, v1 * t1y + v2 * t2y, v1 * t1z + v2 * t2z
            if near > BENT * radius * longest:
                # No nearer to another primitive than the ring is wide.
                share += weight
                mx += weight * ex
                my += weight * ey
                mz += weight * ez
                xx += weight * ex * ex
                xy += weight * ex * ey
                xz += weight * ex * ez
                yy += weight * ey * ey
                yz += weight * ey * ez
                zz += weight * ez * ez
                continue
            dx, dy, dz = c[0] + ex - o[0], c[1] + ey - o[1], c[2] + ez - o[2]
            _, lx, ly, lz, kx, ky, kz = project(
                surfaces.kind[p],
                surfaces.size[p],
                R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz,
                R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz,
                R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz,
            )
            hx, hy, hz = lx + room * kx, ly + room * ky, lz + room * kz
            free = clearance(
                surfaces,
                found,
                p,
                o[0] + R[0, 0] * hx + R[0, 1] * hy + R[0, 2] * hz,
                o[1] + R[1, 0] * hx + R[1, 1] * hy + R[1, 2] * hz,
                o[2] + R[2, 0] * hx + R[2, 1] * hy + R[2, 2] * hz,
                0.0,
            )
            part = weight * exposed(free, prior)
            ex = o[0] + R[0, 0] * lx + R[0, 1] * ly + R[0, 2] * lz - c[0]
            ey = o[1] + R[1, 0] * lx + R[1, 1] * ly + R[1, 2] * lz - c[1]
            ez = o[2] + R[2, 0] * lx + R[2, 1] * ly + R[2, 2] * lz - c[2]
            share += part
            mx += part * ex
            my += part * ey
            mz += part * ez
            xx += part * ex * ex
            xy += part * ex * ey
            xz += part * ex * ez
            yy += part * ey * ey
            yz += part * ey * ez
            zz += part * ez * ez
    found.score[row] += math.log(share)
    if share > WHOLE:
        return False
    mx, my, mz = mx / share, my / share, mz / share
    s = prior.offset * prior.offset
    C[0, 0] = xx / share - mx * mx + s * n[0] * n[0]
    C[0, 1] = xy / share - mx * my + s * n[0] * n[1]
    C[0, 2] = xz / share - mx * mz + s * n[0] * n[2]
    C[1, 1] = yy / share - my * my + s * n[1] * n[1]
    C[1, 2] = yz / share - my * mz + s * n[1] * n[2]
    C[2, 2] = zz / share - mz * mz + s * n[2] * n[2]
    C[1, 0], C[2, 0], C[2, 1] = C[0, 1], C[0, 2], C[1, 2]
    dx, dy, dz = c[0] + mx - o[0], c[1] + my - o[1], c[2] + mz - o[2]
    _, lx, ly, lz, kx, ky, kz = project(
        surfaces.kind[p],
        surfaces.size[p],
        R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz,
        R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz,
        R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz,
    )
    for i in range(3):
        c[i] = o[i] + R[i, 0] * lx + R[i, 1] * ly + R[i, 2] * lz
        n[i] = R[i, 0] * kx + R[i, 1] * ky + R[i, 2] * kz
    return False


@fused_kernel
def stands_on(link, z, nz, spread):  # type: ignore[no-untyped-def]
    """Whether a place is on the face on which the base stands; what stands on the mounting plane, z = 0 of
    the base frame, cannot be touched from below."""
    return link == 0 and z < spread and nz < -0.5
