"""Pieces of voxels as files of version 2 have them, decoded as section 12 of docs/file-format.md says."""

import math

import numpy as np

from decode_voxels import Seen

NEAR = [
    (-1, 0, 0), (0, -1, 0), (0, 0, 1), (-1, -1, 0), (1, -1, 0), (1, 0, 1), (0, 1, 1), (-1, 0, 1),
    (0, -1, 1), (-2, 0, 0), (0, -2, 0), (0, 0, 2), (1, 1, 1), (-1, 1, 1), (1, -1, 1), (-1, -1, 1),
]  # fmt: skip
FAR = [
    (-3, 0, 0), (0, -3, 0), (0, 0, 3), (2, 0, 1), (0, 2, 1), (1, 0, 2),
    (0, 1, 2), (2, -1, 0), (-1, 0, 2), (0, -1, 2), (-2, 0, 1), (0, -2, 1),
]  # fmt: skip
SQUASHED = [round(65536 / (1 + math.exp(8 - i / 2))) for i in range(33)]


def squash(odds):
    """The chance of log odds."""
    i, part = divmod(min(max(odds, -2047), 2047) + 2048, 128)
    return (SQUASHED[i] * (128 - part) + SQUASHED[i + 1] * part) >> 7


def stretched():
    """Log odds of each chance of 4096."""
    table = []
    for odds in range(-2047, 2048):
        table += [odds] * ((squash(odds) >> 4) + 1 - len(table))
    return table + [2047] * (4096 - len(table))


class Bits:
    """The arithmetic decoder."""

    def __init__(self, stream):
        self.stream, self.at, self.low, self.high = stream, 4, 0, 2**32 - 1
        self.code = int.from_bytes(stream[:4], "big")

    def bit(self, chance):
        middle = self.low + ((self.high - self.low) * chance >> 16)
        bit = self.code <= middle
        if bit:
            self.high = middle
        else:
            self.low = middle + 1
        while self.low >> 24 == self.high >> 24:
            self.low = self.low << 8 & 0xFFFFFFFF
            self.high = self.high << 8 & 0xFFFFFFFF | 255
            self.code = self.code << 8 & 0xFFFFFFFF | self.stream[self.at]
            self.at += 1
        return int(bit)


def piece(stream, w, h, d, labels):
    """Dense indices and 1 of a piece's voxels, [z, y, x] (section 12)."""
    bits, table = Bits(stream), stretched()
    even_stretch, even_voxel, near_seen, wide_seen, third_seen, number_seen = (Seen() for _ in range(6))
    weights = {}
    # Three slices before the first, a border of three voxels all around.
    out = np.zeros((d + 3, h + 6, w + 6), np.int64).tolist()

    def number():
        value, context = 0, 1
        for _ in range(labels.bit_length()):
            bit = number_seen.code(bits, context) if context < 65536 else bits.bit(32768)
            value, context = 2 * value + bit, 2 * context + bit
        return value

    def voxel(z, y, x):
        around = [out[z - back][y + dy][x + dx] for dx, dy, back in NEAR + FAR]
        if len(set(around)) == 1:
            return around[0] if even_voxel.code(bits, 0) else number()
        asked = []
        for label in around:
            if label in asked:
                continue
            order = min(len(asked), 2)
            asked.append(label)
            near = sum(1 << i for i in range(16) if around[i] == label)
            far = sum(1 << i for i in range(12) if around[16 + i] == label)
            others = [v for v in around[:9] if v != label]
            third = sum(1 << i for i in range(9) if around[i] not in (label, others[0])) if others else 0
            wide = near & 511 | far << 9 | min(order, 1) << 21
            mixed = near * 0x9E3779B1 ^ third * 0x85EBCA6B ^ (far & 7) * 0xC2B2AE35 ^ order * 77777
            places = (near, wide * 0x9E3779B1 % 2**32 >> 14, mixed * 0x27D4EB2F % 2**32 >> 14)
            seen = list(zip((near_seen, wide_seen, third_seen), places))
            odds = [table[s.chance(place) >> 10] for s, place in seen]
            w3 = weights.setdefault(3 * near.bit_count() + order, [26214] * 3)
            chance = min(max(squash(sum(a * b for a, b in zip(w3, odds)) >> 16), 16), 65520)
            bit = bits.bit(chance)
            for i in range(3):
                step = ((bit << 16) - chance) * odds[i] + 8192 >> 14
                w3[i] = min(max(w3[i] + step, -(2**20)), 2**20)
            for s, place in seen:
                s.learn(place, bit)
            if bit:
                return label
        return number()

    for z in range(3, d + 3):
        for y in range(3, h + 3):
            for x in range(3, w + 3, 16):
                n = min(16, w + 3 - x)
                label = out[z][y][x - 1]
                region = out[z][y - 1][x - 1 : x + n + 1] + out[z][y - 2][x : x + n] + out[z - 2][y][x : x + n]
                for dy in (-1, 0, 1):
                    region += out[z - 1][y + dy][x - 1 : x + n + 1]
                if set(region) == {label} and even_stretch.code(bits, 0):
                    out[z][y][x : x + n] = [label] * n
                    continue
                for i in range(x, x + n):
                    out[z][y][i] = voxel(z, y, i)
    assert bits.at == len(stream), "bytes behind the last voxel"
    return np.array(out)[3:, 3:-3, 3:-3]
