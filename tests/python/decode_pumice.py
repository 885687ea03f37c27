"""An independent decoder of .pumice files, written only from docs/file-format.md.

Needs numpy, and zstandard for compressed files. It shares no code with Pumice and is deliberately slow and plain.

    python decode_pumice.py FILE OUT.npy [FRAME]      ids as uint64, indexed [x, y, z]
"""

import json
import struct
import sys

import numpy as np

import decode_voxels

SIGNATURE = b"\x89PUMICE\n"
# File version, and the two values of `contents`.
VERSION, BOXES, VOXELS = 6, 0, 1


def read_sections(data):
    """Decoded sections of the volume by name, and those of each chunk (sections 2 and 3 of docs/file-format.md)."""
    assert data[:8] == SIGNATURE, "not a .pumice file"
    version, contents, length, table, count, frames = struct.unpack_from("<IIQQII", data, 8)
    assert version == VERSION, f"file version: expected {VERSION}, got {version}"
    assert contents in (BOXES, VOXELS) and (length, table) == (len(data), 64) and frames > 0
    sections, of_chunk = {}, {}
    for i in range(count):
        name, compression, width, filters, zero, offset, stored, decoded, _, chunk, zero_2 = struct.unpack_from(
            "<4sBBBBQQQQII", data, table + 48 * i
        )
        assert offset % 8 == 0 and zero == 0 and zero_2 == 0
        raw = data[offset : offset + stored]
        if compression == 1:
            import zstandard

            raw = zstandard.ZstdDecompressor().decompress(raw, max_output_size=max(decoded, 1))
        assert len(raw) == decoded, name
        elements = np.frombuffer(raw, np.uint8)
        if filters & 2:
            elements = elements.reshape(width, -1).T
        elements = elements.reshape(-1, width)
        if filters & 1:
            wide = np.zeros((len(elements), 8), np.uint8)
            wide[:, :width] = elements
            sums = np.cumsum(wide.view("<u8").ravel(), dtype=np.uint64)
            elements = sums.astype("<u8").view(np.uint8).reshape(-1, 8)[:, :width]
        place = of_chunk.setdefault(chunk - 1, {}) if chunk else sections
        assert name.decode() not in place, f"{name} of {chunk} twice"
        place[name.decode()] = elements.tobytes()
    return sections, [of_chunk[i] for i in range(len(of_chunk))]


def bits(number_of_bits, data):
    """The first bits of a stream as booleans, lowest bit of each byte first."""
    all_bits = np.unpackbits(np.frombuffer(data, np.uint8), bitorder="little")
    assert len(all_bits) - number_of_bits in range(8) and not all_bits[number_of_bits:].any()
    return all_bits[:number_of_bits].astype(bool)


def mask_bits(masks):
    """64-bit masks as rows of 64 booleans, bit 0 first."""
    rows = np.ascontiguousarray(masks, "<u8").view(np.uint8).reshape(-1, 8)
    return np.unpackbits(rows, axis=1, bitorder="little").astype(bool)


def demorton(code):
    """Coordinates (x, y, z) of Morton codes of 24 bits."""
    return np.stack([sum(((code >> (3 * k + a)) & 1) << k for k in range(8)) for a in range(3)], axis=1)


def mirror_images(leaf):
    """Patterns in all eight mirror images, indexed by reference."""
    rows = mask_bits(leaf)
    flips = [(m & 1) * 3 ^ (m >> 1 & 1) * 12 ^ (m >> 2) * 48 for m in range(8)]
    images = np.concatenate([rows[:, np.arange(64) ^ flip] for flip in flips])
    out = np.zeros((8, 8192), np.uint64)
    packed = np.ascontiguousarray(np.packbits(images, axis=1, bitorder="little"))
    out[:, : len(leaf)] = packed.view("<u8").reshape(8, len(leaf))
    return out.ravel()


def tables(s):
    """(patterns by reference, slices, rare fields)."""
    return mirror_images(np.frombuffer(s["LEAF"], "<u8")), np.frombuffer(s["SLIC"], "<u2"), np.frombuffer(s["RARE"], "<u8")


def class_fields(occupied, low, high, ranked, sliced, long, tables):
    """Occupancy fields, one row of 64 per node. Masks are booleans by cell, references are given by class of leaf."""
    patterns, slices, rare = tables

    def of_slices(numbers):
        return np.ascontiguousarray(slices[numbers], "<u2").view("<u8").ravel()

    fields = np.zeros(occupied.shape, np.uint64)
    fields[occupied & ~low & ~high] = np.uint64(2**64 - 1)
    fields[low & ~high] = patterns[ranked]
    fields[~low & high] = of_slices(np.frombuffer(sliced, np.uint8).reshape(-1, 4))
    if len(slices) <= 256:
        fields[low & high] = np.frombuffer(long, "<u8")
    else:
        words = np.frombuffer(long, "<u2").reshape(-1, 3).astype(np.uint64)
        three = words[:, 0] | words[:, 1] << np.uint64(16) | words[:, 2] << np.uint64(32)
        numbers = np.stack([three >> np.uint64(12 * i) & np.uint64(4095) for i in range(4)], axis=1)
        is_rare = numbers[:, 0] == 4095
        values = np.zeros(len(three), np.uint64)
        values[is_rare] = rare[three[is_rare] >> np.uint64(12)]
        values[~is_rare] = of_slices(numbers[~is_rare])
        fields[low & high] = values
    return fields


def boxes_nodes(s):
    """Index of the node of each box, in the packed form."""
    back = np.frombuffer(s["BNOD"], "<u4").astype(np.int64)
    unused = np.cumsum(back == 0) - (back == 0)
    return unused - back


def packed_nodes(s, leaves=None):
    """(fields of the nodes that a chunk has at a frame, index of the node of each box, from the first of them) in the packed form."""
    occupied = mask_bits(np.frombuffer(s["OCCU"], "<u8"))
    classes = bits(2 * occupied.sum(), s["CLAS"]).reshape(-1, 2)
    low, high = np.zeros_like(occupied), np.zeros_like(occupied)
    low[occupied], high[occupied] = classes[:, 0], classes[:, 1]
    ranked = np.frombuffer(s["REFS"], "<u2")
    return class_fields(occupied, low, high, ranked, s["SLCR"], s["FLDS"], tables(leaves or s)), boxes_nodes(s)


def plain_nodes(words, s):
    """(fields of a chunk's nodes, {offset in words: index of the node that starts there}) in the plain form."""
    long_words = 3 if len(s["SLIC"]) > 512 else 4
    rows, number_at, at, all_tables = [], {}, 0, tables(s)
    while at < len(words):
        number_at[at] = len(rows)
        occupied = mask_bits(np.ascontiguousarray(words[at : at + 4]).view("<u8"))
        n = int(occupied.sum())
        to = at + 4 + -(-2 * n // 16)
        classes = np.unpackbits(words[at + 4 : to].view(np.uint8), bitorder="little").astype(bool)
        assert not classes[2 * n :].any()
        low, high = np.zeros_like(occupied), np.zeros_like(occupied)
        low[occupied], high[occupied] = classes[:n], classes[n : 2 * n]
        references = [[], [], []]
        for a, b in zip(classes[:n], classes[n : 2 * n]):
            if a or b:
                size = long_words if a and b else 2 if b else 1
                references[2 if a and b else 1 if b else 0].extend(words[to : to + size])
                to += size
        ranked, sliced, long = (np.array(r, "<u2") for r in references)
        references = (ranked, sliced.tobytes(), long.tobytes())
        rows.append(class_fields(occupied, low, high, *references, all_tables)[0])
        at = to
    return np.array(rows, np.uint64).reshape(-1, 64), number_at


def decode_pieces(s, of_chunk, frame):
    """`decode` for a file of voxels."""
    info = json.loads(s["INFO"])
    dims = info["volume"]["dims"]
    assert len(s["PIEC"]) == 16 * len(of_chunk)
    ids = np.concatenate([np.zeros(1, np.uint64), np.frombuffer(s["LIDS"], "<u8")])
    out = np.zeros(dims, np.uint64)
    for (*origin, of_frame), chunk in zip(struct.iter_unpack("<3II", s["PIEC"]), of_chunk):
        if of_frame != frame:
            continue
        w, h, d = (min(1024, n - o) for n, o in zip(dims, origin))
        dense = decode_voxels.piece(chunk["VOXL"], w, h, d, len(ids) - 1)
        out[tuple(slice(o, o + n) for o, n in zip(origin, (w, h, d)))] = ids[dense].transpose(2, 1, 0)
        assert dense.any(), "a piece without labels"
    return out, info


def decode(data, frame=0):
    """(ids as uint64 indexed [x, y, z], INFO) of a frame from all bytes of a file."""
    s, of_chunk = read_sections(data)
    frames = struct.unpack_from("<I", data, 36)[0]
    assert frame < frames and len(s.get("FRAM", b"")) == (16 * frames if frames > 1 else 0)
    if struct.unpack_from("<I", data, 12)[0] == VOXELS:
        return decode_pieces(s, of_chunk, frame)
    info = json.loads(s["INFO"])
    ids = np.frombuffer(s["LIDS"], "<u8")
    chunks = np.frombuffer(s["CHNK"], [("origin", "<u4", 3), ("frame", "<u4"), ("starts", "<u8", 3)])
    assert len(chunks) == len(of_chunk)
    plain = "NODE" in s
    # Where the boxes of each chunk end, and the words of the nodes that all of its frames have.
    ends = [int(chunk["starts"][0]) for chunk in chunks[1:]] + [None]
    words = sorted({int(chunk["starts"][2]) for chunk in chunks}) + [None]

    # Larger than the volume, since boxes may reach past its end by up to 3 voxels; cut off afterwards.
    dims = info["volume"]["dims"]
    out = np.zeros([d + 16 for d in dims], np.uint64)
    voxels = np.zeros(len(ids), np.uint64)
    runs_before = 0
    # The leaves of the chunk, and the nodes of its frames so far.
    leaves, known, last = None, None, None
    for chunk, c, end_box in zip(chunks, of_chunk, ends):
        first_box, first_run, first_word = (int(v) for v in chunk["starts"])
        runs = np.frombuffer(c["RUNS"], "<u4").reshape(-1, 2).astype(np.int64)
        assert first_run == runs_before
        runs_before += len(runs)
        if last is None or list(chunk["origin"]) != last:
            leaves, known, last = c, np.zeros((0, 64), np.uint64), list(chunk["origin"])
        if plain:
            end_word = words[words.index(first_word) + 1]
            if chunk["frame"] != frame:
                continue
            records = np.frombuffer(s["BOXS"], "<u8")[first_box:end_box]
            cell = np.stack([(records >> np.uint64(40 + 8 * a)) & np.uint64(255) for a in range(3)], axis=1)
            fields, number_at = plain_nodes(np.frombuffer(s["NODE"], "<u2")[first_word:end_word], leaves)
            number = [number_at[int(r) % 2**32] for r in records]
        else:
            code = np.frombuffer(c["BCEL"], np.uint8).reshape(-1, 3).astype(np.int64) @ [1, 256, 65536]
            cell = demorton(code)
            fields, number = packed_nodes(c, leaves)
            number = number + len(known)
            known = fields = np.concatenate([known, fields])
            if chunk["frame"] != frame:
                continue
        for r, (label, start) in enumerate(runs):
            for b in range(start, runs[r + 1, 1] if r + 1 < len(runs) else len(number)):
                x, y, z = (int(v) for v in chunk["origin"] + 4 * cell[b])
                # The axes of a node's bits, slowest first, are cell z, y, x, then voxel z, y, x.
                filled = mask_bits(fields[number[b]]).reshape(4, 4, 4, 4, 4, 4).transpose(2, 5, 1, 4, 0, 3)
                filled = filled.reshape(16, 16, 16)
                region = out[x : x + 16, y : y + 16, z : z + 16]
                filled = filled[tuple(slice(0, e) for e in region.shape)]
                assert not region[filled].any(), "a voxel in two boxes"
                region[filled] = ids[label]
                voxels[label] += np.uint64(filled.sum())
                highest = [int(v.max()) for v in np.nonzero(filled)]
                corner = [v + h - o for v, h, o in zip((x, y, z), highest, chunk["origin"])]
                assert max(corner) < 1024, "a box beyond its chunk"
    inside = tuple(slice(0, d) for d in dims)
    assert np.count_nonzero(out) == np.count_nonzero(out[inside]), "a voxel outside of the volume"
    if frames == 1:
        assert (voxels == np.frombuffer(s["LVOX"], "<u8")).all(), "LVOX"
    else:
        counted = np.zeros(len(ids), np.uint64)
        for chunk, c in zip(chunks, of_chunk):
            if chunk["frame"] == frame:
                counted[np.frombuffer(c["RUNS"], "<u4")[::2]] += np.frombuffer(c["RVOX"], "<u8")
        assert (voxels == counted).all(), "RVOX"
    return out[inside], info


def contacts(data):
    """Pairs of dense indices (a, b), a < b, of labels that touch."""
    s, _ = read_sections(data)
    stream = iter(s["LCON"])

    def varint():
        value = shift = 0
        while True:
            byte = next(stream)
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value

    pairs = []
    for a in range(len(s["LIDS"]) // 8):
        b = a
        for _ in range(varint()):
            b += varint() + 1
            pairs.append((a, b))
    assert next(stream, None) is None
    return pairs


if __name__ == "__main__":
    np.save(sys.argv[2], decode(open(sys.argv[1], "rb").read(), *map(int, sys.argv[3:]))[0])
