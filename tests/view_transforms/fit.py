"""Fits the constants of picture/src/view_transform.rs to the output of `measure.py`, and writes picture/tests/view_transforms.csv:
`python fit.py MEASURED.npz OUT.csv` (numpy, scipy). Prints the constants and the errors of the formula.

    greys      a curve of log2 with knots half a stop apart and Catmull-Rom between them, by least squares
    the rest   AgX: two matrices whose rows add up to 1, and an exponent, by least squares of 8,000 colours with a soft l1 loss
"""

import sys

import numpy as np
from scipy.optimize import least_squares

STOPS = np.linspace(-14, 10, 512)
SATURATED, ORDINARY = slice(513, 12513), slice(12513, 24513)
RANGES = {"Filmic": (-12.5, 4.5), "AgX": (-11.75, 4.25)}
STEP = 0.5


def matrix(six):
    a, b, c, d, e, f = six
    return np.array([[1 - a - b, a, b], [c, 1 - c - d, d], [e, f, 1 - e - f]])


def curve(stops, low, knots):
    place = np.clip((stops - low) / STEP, 0, len(knots) - 1)
    i = np.minimum(place.astype(int), len(knots) - 2)
    u = place - i
    p = np.concatenate([[2 * knots[0] - knots[1]], knots, [2 * knots[-1] - knots[-2]]])
    a, b, c, d = p[i], p[i + 1], p[i + 2], p[i + 3]
    return b + 0.5 * u * (c - a + u * (2 * a - 5 * b + 4 * c - d + u * (3 * (b - c) + d - a)))


def shown(linear, low, knots, thirteen):
    mixed = linear @ matrix(thirteen[:6]).T
    t = np.clip(curve(np.log2(np.maximum(mixed, 2.0**-20)), low, knots), 0, 1)
    power = thirteen[12]
    return np.clip(np.maximum(t**power @ matrix(thirteen[6:12]).T, 0) ** (1 / power), 0, 1)


def main(measured, out):
    found = np.load(measured)
    colors = found["colors"].astype(np.float64)
    for view, (low, high) in RANGES.items():
        truth = found[view]
        grey = truth[:512].mean(axis=1)
        start = np.interp(np.arange(low, high + STEP / 2, STEP), STOPS, grey)
        knots = np.round(np.clip(least_squares(lambda k: curve(STOPS, low, k) - grey, start).x, 0, 1), 5)
        thirteen = np.append(np.zeros(12), 1.0)
        if view == "AgX":
            some = np.random.default_rng(0).choice(np.arange(513, len(colors)), 8000, replace=False)
            start = [0.3, 0.08, 0.1, 0.11, 0.08, 0.17, -0.5, -0.12, -0.17, -0.03, -0.15, -0.23, 2.1]
            off = lambda p: (shown(colors[some], low, knots, p) - truth[some]).ravel()  # noqa: E731
            thirteen = np.round(least_squares(off, start, loss="soft_l1", f_scale=0.02).x, 4)
        print(view, "from", low, knots.tolist(), thirteen.tolist(), sep="\n")
        for name, part in (("greys", slice(0, 513)), ("ordinary", ORDINARY), ("saturated", SATURATED)):
            apart = 255 * np.abs(shown(colors[part], low, knots, thirteen) - truth[part])
            print(f"  {name}: mean {apart.mean():.2f}, 99 % {np.quantile(apart, 0.99):.1f}, most {apart.max():.1f} of 255")
    some = np.concatenate([np.arange(0, 513, 16), np.arange(513, 12513, 60), np.arange(12513, 24513, 60)])
    rows = np.hstack([colors, found["Filmic"], found["AgX"]])[some]
    np.savetxt(out, rows, "%.6g", ",", header="red,green,blue,Filmic,,,AgX,,", comments="")


if __name__ == "__main__":
    main(*sys.argv[1:])
