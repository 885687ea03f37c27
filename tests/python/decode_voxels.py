"""Decodes pieces of voxels as section 6 of docs/file-format.md describes; deliberately slow and plain."""

import numpy as np

# Neighbours as (step along x, step along y, number of slices back).
NEAR = [
    (-1, -1, 0), (0, -1, 0), (1, -1, 0), (2, -1, 0), (-1, 0, 1), (0, 0, 1), (1, 0, 1), (2, 0, 1), (-1, -1, 1), (0, -1, 1),
    (1, -1, 1), (-1, 1, 1), (0, 1, 1), (1, 1, 1), (-2, 0, 0), (0, -2, 0), (0, 0, 2), (2, -1, 1), (2, 1, 1),
]  # fmt: skip
FAR = [
    (-2, 0, 1), (0, 2, 1), (0, -2, 1), (3, 0, 1), (-1, 0, 2), (1, 0, 2), (0, 1, 2), (0, -1, 2), (3, -1, 0),
    (-2, -1, 0), (-1, -2, 0), (1, -2, 0), (-1, -2, 1), (1, -2, 1), (-1, 2, 1), (1, 2, 1), (-2, -1, 1), (-2, 1, 1),
    (-3, 0, 1), (4, 0, 1), (5, 0, 1), (-4, 0, 1), (0, 3, 1), (0, -3, 1), (2, 2, 1), (-2, 2, 1), (2, -2, 1),
    (-2, -2, 1), (6, 0, 1), (-5, 0, 1), (4, -1, 0), (5, -1, 0), (3, 0, 2), (-3, 0, 2), (8, 0, 1), (-7, 0, 1),
]  # fmt: skip
EIGHT = [(-1, -1, 0), (0, -1, 0), (1, -1, 0), (0, -1, 1), (-1, 0, 1), (0, 0, 1), (1, 0, 1), (0, 1, 1)]


class Bits:
    """The arithmetic decoder."""

    def __init__(self, stream):
        self.stream, self.at, self.range = stream, 8, 2**64 - 1
        self.code = int.from_bytes(stream[:8], "big")

    def bit(self, chance):
        part = (self.range >> 16) * chance
        bit = self.code < part
        if bit:
            self.range = part
        else:
            self.code, self.range = self.code - part, self.range - part
        if self.range < 2**32:
            assert self.at + 4 <= len(self.stream), "the stream ends before the last voxel"
            self.range <<= 32
            self.code = self.code << 32 | int.from_bytes(self.stream[self.at : self.at + 4], "big")
            self.at += 4
        return int(bit)


class Seen:
    """Adaptive contexts: for each, the probability of a 1 in units of 2**-22, and a count."""

    def __init__(self):
        self.contexts = {}

    def chance(self, context):
        return self.contexts.get(context, (1 << 21, 0))[0]

    def learn(self, context, bit):
        chance, count = self.contexts.get(context, (1 << 21, 0))
        way = (2**22 - 1 if bit else 0) - chance
        self.contexts[context] = (chance + (way * (131072 // (2 * count + 3)) >> 16), min(count + 1, 255))

    def code(self, bits, context):
        bit = bits.bit(min(max(self.chance(context) >> 6, 16), 65520))
        self.learn(context, bit)
        return bit


def number(bits, seen, n, contexts):
    """A number of n bits, highest first. Each bit uses the context of the bits before it if that is below `contexts`, else even odds."""
    value, context = 0, 1
    for _ in range(n):
        bit = seen.code(bits, context) if context < contexts else bits.bit(32768)
        value, context = 2 * value + bit, 2 * context + bit
    return value


def piece(stream, w, h, d, labels):
    """Values of a piece's voxels indexed [z, y, x]: dense index + 1, or 0."""
    bits = Bits(stream)
    whole, far_seen, number_seen = Seen(), Seen(), Seen()
    place = [Seen() for _ in range(12)]
    near_seen = [Seen() for _ in range(3)]
    # Two extra slices before the first, and a border as wide as the farthest neighbours.
    out = np.zeros((d + 2, h + 6, w + 16), np.int64).tolist()

    def around(z, y, x, steps):
        return [out[z - back][y + dy][x + dx] for dx, dy, back in steps]

    def voxel(z, y, x, breaks):
        near = around(z, y, x, NEAR)
        left = out[z][y][x - 1]
        asked = []
        for label in [left, near[1], near[5], *near]:
            if label in asked:
                continue
            asked.append(label)
            if label == left and breaks:
                continue
            having = sum(1 << i for i in range(17) if near[i] == label)
            if near_seen[min(len(asked) - 1, 2)].code(bits, having):
                return label
        for i, label in enumerate(around(z, y, x, FAR)):
            if label not in asked:
                asked.append(label)
                if far_seen.code(bits, i):
                    return label
        return number(bits, number_seen, labels.bit_length(), 65536)

    for z in range(2, d + 2):
        for y in range(3, h + 3):
            row, x = out[z][y], 8
            while x < w + 8:
                label, n = row[x - 1], 0
                while x + n < w + 8 and set(around(z, y, x + n, EIGHT)) == {label}:
                    n += 1
                if n:
                    size = n.bit_length()
                    run = n if whole.code(bits, size) else number(bits, place[size], (n - 1).bit_length(), 128)
                    assert run <= n
                    row[x : x + run] = [label] * run
                    x += run
                    if run == n:
                        continue
                row[x] = voxel(z, y, x, n > 0)
                x += 1
    assert bits.at == len(stream), "there are bytes after the last voxel"
    return np.array(out)[2:, 3:-3, 8:-8]
