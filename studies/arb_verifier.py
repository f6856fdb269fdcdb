"""Check the boxes of a bound over all poses with the balls of arb, which enclose every rounding.

`pip install 'edtk[proof]' && python studies/arb_verifier.py CERTIFICATE.json`; nothing of edtk is
imported. It knows arms that turn, a fixed force at the tool point, positions, and white noise.
"""

# ruff: noqa: B905
import json
import sys
from itertools import groupby, product
from math import pi, prod, remainder
from pathlib import Path

from flint import acb, acb_poly, arb, arb_mat, ctx

ctx.prec, N, TINY, TURN = 80, 9, 1e-12, 2 * pi  # bits; numbers of an angle at degree 4; radians


def sampled(s: dict, Z: arb_mat) -> dict:
    """Values of d and of the slacks at 9 angles of each joint, the last joint fastest."""
    w, joints, found = s["workspace"], s["robot"]["joints"], {name: [] for name in "*hrud"}
    low, far = arb(w.get("height_min_mm", -1e6)) / 1000, arb(w.get("radius_min_mm", 0)) / 1000
    steep = (arb(w.get("tilt_max_deg", 90)) * arb.pi() / 180).sin() + arb(TINY)

    assert all(joint["kind"] == "revolute" for joint in joints), "a joint does not turn"

    def pose(j: int, frame: arb_mat, moving: list) -> None:
        if j < len(joints):
            frame, (x, y, z) = frame * arb_mat(joints[j]["origin"]), joints[j]["axis"]
            K = arb_mat([[0, -z, y, 0], [z, 0, -x, 0], [-y, x, 0, 0], [0, 0, 0, 0]])
            angles = [2 * arb.pi() * k / N for k in range(N)]
            for t in angles if j in s["free"] else [arb(s["fixed"][j])]:
                turned = frame + frame * (K * t.sin() + K * K * (1 - t.cos()))
                pose(j + 1, turned, [*moving, frame * K * frame.inv()])
            return
        frame = frame * arb_mat(s["robot"]["tool"])
        x, y, z, up = frame[0, 3], frame[1, 3], frame[2, 3], frame[2, 2]
        swings = [(moving[j] * arb_mat(4, 1, [x, y, z, 1])).entries() for j in s["unknown"]]
        loads = [sum(c * arb(F) for c, F in zip(v, s["load"]["F_N"])) for v in swings]
        A = [[c * t / arb(e) for c, e in zip(v, s["sigma"])] for v, t in zip(swings, loads)]
        M = Z * (arb_mat(A) * arb_mat(A).transpose())
        slacks = (
            z - low + arb(TINY),
            x * x + y * y - far * far + arb(TINY),
            steep - up,
            steep + up,
        )
        for name, f in zip("*hrud", (sum((M[i, i] for i in range(len(A))), arb(0)), *slacks)):
            found[name].append(f)

    pose(0, arb_mat(s["robot"]["base"]), [])
    return found


def part(i: int, z: acb) -> arb:
    """Of exp(ikt) the i-th of 1, cos t, sin t, cos 2t, ..."""
    return z.imag if i and i % 2 == 0 else z.real


def fourier(values: list, v: int) -> dict:
    """Coefficients {(i_1, ..., i_v): c} by products of 1, cos t, sin t, cos 2t, ..."""
    waves = [[acb(0, 2 * arb.pi() * (k * i) / N).exp() / N for i in range(N)] for k in range(5)]
    rows = [[part(i, z) * (2 if i else 1) for z in waves[(i + 1) // 2]] for i in range(N)]
    for _ in range(v):  # each product makes the first axis the last one
        values = (arb_mat(rows) * arb_mat(N, len(values) // N, values)).transpose().entries()
    return dict(zip(product(range(N), repeat=v), values))


def within(limits: list, j: int, v: int) -> dict:
    """Cosine of a joint less its least one: not negative within limits, nor beside by a turn."""
    low, high = map(arb, limits)
    middle, half = (low + high) / 2, (high - low) / 2
    c = (arb(TINY) - half.cos(), middle.cos(), middle.sin())
    return {tuple(i * (k == j) for k in range(v)): x for i, x in enumerate(c)}


def linked(f: dict, links: list) -> dict:
    """Coefficients with sums s = t_j + e t_i as variables in the places of angles t_j."""
    for i, j, e in links:
        found: dict = {}
        for key, x in f.items():
            for (a, z), (b, w) in product(waves(key[i]), waves(key[j])):
                for (m, u), (n, y) in product(parts(a - e * b), parts(b)):
                    # Imaginary parts are those of a real number: together they are none.
                    if c := (z * w * u * y).real:
                        own = tuple({i: m, j: n}.get(k, old) for k, old in enumerate(key))
                        found[own] = found.get(own, arb(0)) + x * c
        f = found
    return f


def waves(i: int) -> list:
    """The i-th of 1, cos t, sin t, cos 2t, ... as [(k, z)], the sum of z exp(ikt)."""
    k, (z, w) = (i + 1) // 2, (0.5, 0.5) if i % 2 else (-0.5j, 0.5j)
    return [(k, z), (-k, w)] if i else [(0, 1.0)]


def parts(k: int) -> list:
    """exp(ikt) as the sum of [(i, z)], z times the i-th of 1, cos t, sin t, cos 2t, ..."""
    n = abs(k)
    return [(2 * n - 1, 1.0), (2 * n, 1j if k > 0 else -1j)] if k else [(0, 1.0)]


def moved(f: dict, motions: list) -> dict:
    """Coefficients; what is tiny, or motions change, widens the first."""
    least, first, *rest = sum(abs(x) for x in f.values()) * arb(2) ** -56, *f.items()
    error = sum((abs(x) for _, x in rest if abs(x) < least), arb(0))
    for m in motions:  # a mirror changes the signs of sines, half a turn those of odd orders
        for i, x in rest:
            each = zip(i, m["mirrors"], m["turns"])
            odd = sum(a * (n > 0 and n % 2 == 0) + b * ((n + 1) // 2) for n, a, b in each)
            error += 2 * abs(x) * (odd % 2)
    kept = {i: x for i, x in rest if not abs(x) < least}
    return {first[0]: first[1] + arb(0, error.upper()), **kept}


def local(n: int, middle: arb, half: arb) -> arb_mat:
    """From coefficients on the circle to those of the normalised B-basis of an interval."""
    assert half < arb.pi() / 2, "an interval has no such basis"
    m, e, columns = n // 2, acb(0, half / 2).exp(), []
    w = acb_poly([1, 2 * half.cos(), 1]) ** m
    for i, k in ((i, (i + 1) // 2) for i in range(n)):
        p = acb_poly([1 / e, e]) ** (m + k) * acb_poly([e, 1 / e]) ** (m - k)
        columns.append([part(i, p[j] / w[j] * acb(0, k * middle).exp()) for j in range(n)])
    return arb_mat(columns).transpose()


def leaves(c: dict) -> dict:
    """Boxes ((depth, place), ...) and factors by what closes them, read from the tree's text."""
    boxes = [tuple((0, i) for i in place) for place in product(*map(range, c["parts"]))][::-1]
    factors, found = iter(c["factors"]), {}
    assert boxes, "no box covers the domain"
    for letter in c["tree"]:
        box = boxes.pop()  # an error where the text goes on
        if letter.isdigit():
            j, (depth, place) = int(letter), box[int(letter)]
            boxes += [(*box[:j], (depth + 1, 2 * place + i), *box[j + 1 :]) for i in (1, 0)]
            continue
        mu = {a: x for a, x in zip(c["slacks"], next(factors)) if x} if letter == "+" else {}
        assert all(x > 0 for x in mu.values())
        names = {".": ("*",), "+": ("*", *mu)}.get(letter, (letter,))
        found.setdefault(names, []).append((box, tuple(mu.values())))
    assert not boxes, "a leaf is missing"
    return found


def still_open(c: dict, box: list, forms: list, some: list, shape: list, j: int = 0) -> int:
    """The number of leaves where f_0 + sum factor f, of forms with these axes, may be above 0."""
    count, (low, high) = 0, map(arb, box[j])
    for (depth, place), group in groupby(some, key=lambda leaf: leaf[0][j]):
        width = (high - low) / c["parts"][j] / 2**depth
        T = local(shape[j], low + width * (2 * place + 1) / 2, width / 2 + 4 * arb(TINY))
        matrices = [arb_mat(shape[j], prod(shape) // shape[j], f) for f in forms]
        if j + 1 < len(shape):
            moved = [(T * f).transpose().entries() for f in matrices]
            count += still_open(c, box, moved, list(group), shape, j + 1)
            continue
        for _, factors in group:
            mixed = sum((f * arb(x) for f, x in zip(matrices[1:], factors)), matrices[0])
            count += not all(x <= 0 for x in (T * mixed).entries())
    return count


def left(s: dict, c: dict) -> list:
    """The intervals that motions leave of the boxes' ones, if these reach all that is allowed."""
    limits = [s["robot"]["joints"][j]["limits"] for j in s["free"]]
    for i, j, e in c.get("links", []):
        assert i != j, "no sum of two angles"
        assert e in (1, -1), "no sign"
        ends = sorted(e * end for end in limits[i])
        limits[j] = [a + b for a, b in zip(limits[j], ends)]
    box = list(zip(c["low"], c["high"]))
    whole = [b - a > TURN - TINY for a, b in box]
    assert c["joints"] == list(range(len(limits))), "a joint is left out"
    assert all(w or (a <= x and y <= b) for w, (a, b), (x, y) in zip(whole, box, limits))
    for m in c["motions"]:  # t -> t or -t, and half a turn or not: they map the box to itself
        shift = [pi * turn for turn in m["turns"]]
        fixed = [abs(remainder(a + b - c, TURN)) < TINY for (a, b), c in zip(box, shift)]
        each = zip(whole, fixed, m["mirrors"], m["turns"])
        assert all(w or (centred if mirror else not turn) for w, centred, mirror, turn in each)
        j, a, b = m["joint"], m["low"], m["high"]  # with its image it is the whole interval
        at_end = abs(remainder(2 * a - shift[j], TURN)) < TINY
        assert at_end if m["mirrors"][j] else m["turns"][j]
        assert b - a > min(box[j][1] - box[j][0], TURN) / 2 - TINY
        assert whole[j] or box[j][0] <= a < b <= box[j][1]
        box[j], whole[j] = (a, b), False
    return box


def check(s: dict, c: dict, Z: arb_mat) -> int:
    """The number of leaves that may hold a larger sensitivity than the limit."""
    box, v, links = left(s, c), len(s["free"]), c.get("links", [])
    f = {name: fourier(values, v) for name, values in sampled(s, Z).items()}
    limits = [s["robot"]["joints"][j]["limits"] for j in s["free"]]
    summed = [j for _, j, _ in links if limits[j][1] - limits[j][0] < TURN]
    f |= {name: within(limits[j], j, v) for name, j in zip("KLMNP", summed)}
    f = {name: moved(linked(own, links), c["motions"]) for name, own in f.items()}
    f["*"][(0,) * v] -= arb(c["limit"]) * (1 + arb(10) ** -9)
    count = 0
    for names, some in leaves(c).items():
        largest = [max(i[j] for name in names for i in f[name]) for j in range(v)]
        shape = [n + 1 + n % 2 for n in largest]
        every = list(product(*map(range, shape)))
        forms = [[f[name].get(i, arb(0)) for i in every] for name in names]
        count += still_open(c, box, forms, sorted(some), shape)
    return count


if __name__ == "__main__":
    content = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    proof = content["proof"]["continuum"]
    for Z, c in zip(proof["multipliers"], proof["coverings"]):
        count = check(content["setting"], c, arb_mat(Z))
        print(f"{count} of {sum(map(len, leaves(c).values()))} boxes are open at {c['limit']:.10g}")
