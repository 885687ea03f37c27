// One 64-wide node: twin of core/src/node.rs and leaves.rs. Nodes start at any 16-bit word. They are read by aligned 32-bit words, so
// devices need no 16-bit memory access. A read may go past the end of a node, into another or into spare zeros.
#ifndef NODE_GLSL
#define NODE_GLSL

#include "layout.glsl"

const uint OCCUPIED_WORDS = 4u;
const uint MAX_PATTERNS = 8192u;
// Number of a first slice that marks the field as a rare one.
const uint RARE = 4095u;
// Header of the leaves: words of a long reference, byte offset of the patterns, byte offset of the rare fields. Slices follow it.
const uint LEAVES_HEADER_BYTES = 16u;

struct NodeRef {
    uint64_t occupied;
    // Classes of cells by rank: the lower and the upper bit of each.
    uint64_t low;
    uint64_t high;
    // Address of the 32-bit word that holds the first 16-bit one, and whether that is its upper half.
    Address words;
    uint odd;
    // First word of the references.
    uint references;
    Address leaves;
};

uint64_t word64(Address words, uint odd, uint at) {
    Words w = Words(words);
    uint half_word = at + odd;
    uint i = half_word >> 1;
    uint64_t low = uint64_t(w.at[i]) | (uint64_t(w.at[i + 1u]) << 32);
    return (half_word & 1u) == 0u ? low : (low >> 16) | (uint64_t(w.at[i + 2u]) << 48);
}

uint word16(Address words, uint odd, uint at) {
    uint half_word = at + odd;
    return (Words(words).at[half_word >> 1] >> ((half_word & 1u) << 4)) & 0xFFFFu;
}

uint count_ones64(uint64_t v) {
    return uint(bitCount(uint(v)) + bitCount(uint(v >> 32)));
}

uint64_t below64(uint rank) {
    return rank == 64u ? 0xFFFFFFFFFFFFFFFFUL : (1UL << rank) - 1UL;
}

uint header_words(uint occupied_cells) {
    return OCCUPIED_WORDS + (2u * occupied_cells + 15u) / 16u;
}

NodeRef node_read(Address nodes, uint64_t at, Address leaves) {
    NodeRef node;
    node.words = nodes + ((at >> 1) << 2);
    node.odd = uint(at) & 1u;
    node.leaves = leaves;
    node.occupied = word64(node.words, node.odd, 0u);
    uint n = count_ones64(node.occupied);
    uint64_t first = word64(node.words, node.odd, OCCUPIED_WORDS);
    uint64_t second = word64(node.words, node.odd, OCCUPIED_WORDS + 4u);
    node.low = first & below64(n);
    // The bits from n on. Shifts by 64 are undefined, so 0 and 64 are treated apart.
    node.high = (n == 64u ? second : n == 0u ? 0UL : (first >> n) | (second << (64u - n))) & below64(n);
    node.references = header_words(n);
    return node;
}

bool bit64(uint64_t v, uint i) {
    return (uint(v >> i) & 1u) != 0u;
}

uint reference_words(uint64_t low, uint64_t high, uint beyond_3) {
    return count_ones64(low) + 2u * count_ones64(high) + beyond_3 * count_ones64(low & high);
}

// The number that a voxel's number in its cell is XORed with, where the field is mirrored along these axes.
uint flip_of(uint mirrors) {
    return (mirrors & 1u) * 3u | ((mirrors >> 1) & 1u) * 12u | (mirrors >> 2) * 48u;
}

// A field whose voxel v is voxel v ^ flip of another field.
uint64_t flipped(uint64_t field, uint flip) {
    uint64_t f = field;
    if ((flip & 3u) != 0u) {
        f = ((f & 0x1111111111111111UL) << 3) | ((f & 0x2222222222222222UL) << 1) | ((f >> 1) & 0x2222222222222222UL)
            | ((f >> 3) & 0x1111111111111111UL);
    }
    if ((flip & 12u) != 0u) {
        f = ((f & 0x000F000F000F000FUL) << 12) | ((f & 0x00F000F000F000F0UL) << 4) | ((f >> 4) & 0x00F000F000F000F0UL)
            | ((f >> 12) & 0x000F000F000F000FUL);
    }
    if ((flip & 48u) != 0u) {
        f = (f << 48) | ((f & 0xFFFF0000UL) << 16) | ((f >> 16) & 0xFFFF0000UL) | (f >> 48);
    }
    return f;
}

uint64_t leaf_slice(Address leaves, uint number) {
    return uint64_t((Words(leaves + LEAVES_HEADER_BYTES).at[number >> 1] >> ((number & 1u) << 4)) & 0xFFFFu);
}

uint64_t leaf_of_slices(Address leaves, uint a, uint b, uint c, uint d) {
    return leaf_slice(leaves, a) | (leaf_slice(leaves, b) << 16) | (leaf_slice(leaves, c) << 32) | (leaf_slice(leaves, d) << 48);
}

uint64_t leaf_sliced(Address leaves, uint first, uint second) {
    return leaf_of_slices(leaves, first & 255u, first >> 8, second & 255u, second >> 8);
}

// The field of a long reference, given the first 4 words of the reference.
uint64_t leaf_long(Address leaves, uint beyond_3, uint64_t words) {
    if (beyond_3 == 1u) {
        return words;
    }
    uint64_t three = words & 0xFFFFFFFFFFFFUL;
    if ((uint(three) & RARE) == RARE) {
        return Longs(leaves + Words(leaves).at[2]).at[uint(three >> 12)];
    }
    return leaf_of_slices(leaves, uint(three) & RARE, uint(three >> 12) & RARE, uint(three >> 24) & RARE, uint(three >> 36));
}

// Pattern of a ranked reference, and its flip.
uint64_t leaf_ranked(Address leaves, uint word, out uint flip) {
    flip = flip_of(word / MAX_PATTERNS);
    return Longs(leaves + Words(leaves).at[1]).at[word % MAX_PATTERNS];
}

// A field and a flip: voxel v of the cell is voxel v ^ flip of the field.
uint64_t node_flipped_field(NodeRef node, uint c, out uint flip) {
    flip = 0u;
    uint64_t bit = 1UL << c;
    if ((node.occupied & bit) == 0UL) {
        return 0UL;
    }
    uint rank = count_ones64(node.occupied & (bit - 1UL));
    uint64_t below = below64(rank);
    uint beyond_3 = Words(node.leaves).at[0] - 3u;
    uint at = node.references + reference_words(node.low & below, node.high & below, beyond_3);
    bool low = bit64(node.low, rank), high = bit64(node.high, rank);
    if (!low && !high) {
        return 0xFFFFFFFFFFFFFFFFUL;
    }
    if (low && high) {
        return leaf_long(node.leaves, beyond_3, word64(node.words, node.odd, at));
    }
    uint first = word16(node.words, node.odd, at);
    return high ? leaf_sliced(node.leaves, first, word16(node.words, node.odd, at + 1u))
                : leaf_ranked(node.leaves, first, flip);
}

// Whether a cell has this voxel.
bool node_has(NodeRef node, uint c, uint voxel) {
    uint flip;
    uint64_t field = node_flipped_field(node, c, flip);
    return bit64(field, voxel ^ flip);
}

uint64_t node_field(NodeRef node, uint c) {
    uint flip;
    uint64_t field = node_flipped_field(node, c, flip);
    return flipped(field, flip);
}

#endif
