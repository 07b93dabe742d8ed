"""Nearest point on an ellipsoid."""

from math import sqrt

from robots.compiled import kernel


@kernel
def nearest_on_ellipsoid(size, x, y, z):  # type: ignore[no-untyped-def]
    """Signed distance, nearest surface point and outward unit normal, as of `robots.surface.project`."""
    # Nearest point c with c_i = a_i^2 y_i / (t + a_i^2); t is the largest root of F(t) = sum (a_i y_i / (t +
    # a_i^2))^2 - 1, which falls and is convex, so Newton from the left runs monotonously into it (Eberly,
    # "Distance from a point to an ellipse, an ellipsoid, or a hyperellipsoid", 2013).
    a, b, c = size[0], size[1], size[2]
    aa, bb, cc = a * a, b * b, c * c
    least = min(aa, min(bb, cc))
    # Squares of the parts of the query along the shortest axis, or axes, where F has its pole.
    short = 0.0
    if aa == least:
        short += x * x
    if bb == least:
        short += y * y
    if cc == least:
        short += z * z
    lift = sqrt(least * short)
    # F at the left end of the bracket; the shortest axes give exactly 1 there, also in the limit lift = 0.
    rest = 0.0
    if aa > least:
        rest += (a * x / (lift + (aa - least))) ** 2
    if bb > least:
        rest += (b * y / (lift + (bb - least))) ** 2
    if cc > least:
        rest += (c * z / (lift + (cc - least))) ** 2
    if lift > 1e-14 * least or rest >= 1.0:
        w = lift  # t + least
        for _ in range(60):
            ia, ib, ic = w + (aa - least), w + (bb - least), w + (cc - least)
            if ia <= 0.0 or ib <= 0.0 or ic <= 0.0:
                # On the pole itself (short = 0): step off it to the right.
                w = 1e-15 * least
                continue
            ga, gb, gc = a * x / ia, b * y / ib, c * z / ic
            F = ga * ga + gb * gb + gc * gc - 1.0
            slope = -2.0 * (ga * ga / ia + gb * gb / ib + gc * gc / ic)
            if slope == 0.0:
                break
            step = -F / slope
            w += step
            if step <= 1e-16 * w:
                break
        px = aa * x / (w + (aa - least))
        py = bb * y / (w + (bb - least))
        pz = cc * z / (w + (cc - least))
    else:
        # Deep inside, in the plane of symmetry across a shortest axis: both sides are equally near, take the
        # plus side.
        px = aa * x / (aa - least) if aa > least else 0.0
        py = bb * y / (bb - least) if bb > least else 0.0
        pz = cc * z / (cc - least) if cc > least else 0.0
        height = sqrt(least * max(0.0, 1.0 - px * px / aa - py * py / bb - pz * pz / cc))
        if aa == least:
            px = height if x >= 0.0 else -height
        elif bb == least:
            py = height if y >= 0.0 else -height
        else:
            pz = height if z >= 0.0 else -height
    nx, ny, nz = px / aa, py / bb, pz / cc
    norm = sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = nx / norm, ny / norm, nz / norm
    ex, ey, ez = x - px, y - py, z - pz
    distance = sqrt(ex * ex + ey * ey + ez * ez)
    if (x / a) ** 2 + (y / b) ** 2 + (z / c) ** 2 < 1.0:
        distance = -distance
    return distance, px, py, pz, nx, ny, nz
