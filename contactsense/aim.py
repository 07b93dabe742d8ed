"""The search where the wrench axis tells where to look: one optimum on every primitive that it may enter."""

import math

from contactsense.candidates import store
from contactsense.energy import energy_at, lean_in, loosen
from contactsense.refine import CUT, refine
from contactsense.seed import enter
from contactsense.view import view
from robots.compiled import fused_kernel


@fused_kernel
def search_along(surfaces, touchable, hypotheses, prior, work, found):  # type: ignore[no-untyped-def]
    """Fill row p of `found` with the most probable contact on primitive p, for those that `order` lists then.

    Returns:
        How many rows `order` lists; the `score` of those given up is -infinity.
    """
    count = _aim_all(surfaces, touchable, hypotheses, prior, found, work)
    least = math.inf
    for i in range(count):
        # Most promising first, so that the others can be given up early.
        for k in range(i + 1, count):
            if found.score[found.order[k]] < found.score[found.order[i]]:
                found.order[i], found.order[k] = found.order[k], found.order[i]
        p = found.order[i]
        own = hypotheses.energy[surfaces.link[p]]
        if own > least + CUT:
            found.score[p] = -math.inf
            continue
        w, c, n = found.wrench[p], found.point[p], found.normal[p]
        fx, fy, fz = lean_in(w[0], w[1], w[2], n[0], n[1], n[2])
        result = refine(
            surfaces.kind[p], surfaces.size[p], w, found.information[p], prior, least + CUT - own,
            c[0], c[1], c[2], n[0], n[1], n[2], fx, fy, fz, 0.0, work,
        )  # fmt: skip
        found.score[p] = result[1] - own
        if result[1] > -math.inf:
            store(found, p, p, result, work, prior.offset)
            least = min(least, own + result[0])
    return count


@fused_kernel
def _aim_all(surfaces, touchable, hypotheses, prior, found, work):  # type: ignore[no-untyped-def]
    """First guess on every touchable primitive that is worth a search: listed in `order`, its energy as
    `score`.

    The guess, body frame, is where the wrench axis enters the primitive or comes nearest. A primitive is left
    out where bringing the axis to it costs more than the search would forgive.
    """
    ceiling = math.inf
    count = 0
    last, last_energy = -1, -math.inf
    for _ in range(touchable.shape[0]):
        # Links by rising energy: the first ones set a ceiling above which the last ones need no look.
        link, own = -1, math.inf
        for k in range(touchable.shape[0]):
            e = hypotheses.energy[k]
            later = e > last_energy or (e == last_energy and k > last)
            if touchable[k] and later and (link < 0 or e < own):
                link, own = k, e
        if link < 0 or own > ceiling + CUT:
            break
        last, last_energy = link, own
        w, P, L = hypotheses.wrench[link], hypotheses.covariance[link], hypotheses.information[link]
        fx, fy, fz = w[0], w[1], w[2]
        ff = fx * fx + fy * fy + fz * fz
        if ff <= 0.0:
            continue
        for p in range(surfaces.start[link], surfaces.start[link + 1]):
            ox, oy, oz = found.origin[p, 0], found.origin[p, 1], found.origin[p, 2]
            mx, my, mz = w[3] - oy * fz + oz * fy, w[4] - oz * fx + ox * fz, w[5] - ox * fy + oy * fx
            ax, ay, az = fy * mz - fz * my, fz * mx - fx * mz, fx * my - fy * mx
            kind, size, radius = surfaces.kind[p], surfaces.size[p], surfaces.radius[p]
            limit = ceiling + CUT - own
            away = math.sqrt(ax * ax + ay * ay + az * az) / ff - radius
            if away > 0.0 and _shift_energy(away, P, ox, oy, oz, ff, prior) > limit:
                continue
            v, B = found.wrench[p], found.information[p]
            view(w, L, found.rotation[p], found.origin[p], v, B)
            gap, cx, cy, cz, nx, ny, nz = enter(kind, size, radius, v[0], v[1], v[2], v[3], v[4], v[5])
            if gap > 0.0 and _shift_energy(gap, P, ox, oy, oz, ff, prior) > limit:
                continue
            hx, hy, hz = lean_in(v[0], v[1], v[2], nx, ny, nz)
            loose = loosen(B, prior, nx, ny, nz, hx, hy, hz)
            energy = own + energy_at(v, B, prior, loose, cx, cy, cz, nx, ny, nz, hx, hy, hz, 0.0)
            ceiling = min(ceiling, energy)
            found.point[p, 0], found.point[p, 1], found.point[p, 2] = cx, cy, cz
            found.normal[p, 0], found.normal[p, 1], found.normal[p, 2] = nx, ny, nz
            found.score[p] = energy
            found.order[count] = p
            count += 1
    return count


@fused_kernel
def _shift_energy(gap, P, ox, oy, oz, ff, prior):  # type: ignore[no-untyped-def]
    """Energy of bringing the wrench axis nearer to the point o by `gap` [m], about: the moment about o must
    change by |f| gap. P: covariance of the wrench; ff: square of its force."""
    return 0.5 * ff * gap * gap / (moment_variance(P, ox, oy, oz) + prior.offset * prior.offset * ff)


@fused_kernel
def moment_variance(P, ox, oy, oz):  # type: ignore[no-untyped-def]
    """Trace of the covariance of the moment about a point, P being that of the wrench about the
    origin."""
    cross = oz * (P[0, 4] - P[1, 3]) + oy * (P[2, 3] - P[0, 5]) + ox * (P[1, 5] - P[2, 4])
    oo = ox * ox + oy * oy + oz * oz
    oPo = (
        ox * (P[0, 0] * ox + 2.0 * P[0, 1] * oy + 2.0 * P[0, 2] * oz)
        + oy * (P[1, 1] * oy + 2.0 * P[1, 2] * oz)
        + oz * oz * P[2, 2]
    )
    trace = P[3, 3] + P[4, 4] + P[5, 5] - 2.0 * cross + oo * (P[0, 0] + P[1, 1] + P[2, 2]) - oPo
    return max(trace, 0.0)
