// One 64-wide node: twin of core/src/node.rs. Nodes start at any 16-bit word; they are read by aligned 32-bit words, so that
// devices need not have 16-bit memory access. The last read of an odd node reaches 2 bytes past its end.
#ifndef NODE_GLSL
#define NODE_GLSL

#include "layout.glsl"

const uint NODE_HEADER_WORDS = 12u;

struct NodeRef {
    uint64_t occupied;
    uint64_t solid;
    uint64_t ranked;
    // Address of the 32-bit word that holds the first 16-bit one, and whether that is its upper half.
    Address words;
    uint odd;
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

NodeRef node_read(Address nodes, uint64_t at, Address leaves) {
    NodeRef node;
    node.words = nodes + ((at >> 1) << 2);
    node.odd = uint(at) & 1u;
    node.leaves = leaves;
    node.occupied = word64(node.words, node.odd, 0u);
    node.solid = word64(node.words, node.odd, 4u);
    node.ranked = word64(node.words, node.odd, 8u);
    return node;
}

bool bit64(uint64_t v, uint i) {
    return (uint(v >> i) & 1u) != 0u;
}

uint64_t node_field(NodeRef node, uint c) {
    uint64_t bit = 1UL << c;
    if ((node.occupied & bit) == 0UL) {
        return 0UL;
    }
    if ((node.solid & bit) != 0UL) {
        return 0xFFFFFFFFFFFFFFFFUL;
    }
    uint64_t below = bit - 1UL;
    if ((node.ranked & bit) != 0UL) {
        uint rank = count_ones64(node.ranked & below);
        return Longs(node.leaves).at[word16(node.words, node.odd, NODE_HEADER_WORDS + rank)];
    }
    // `inline` is a word of the language.
    uint64_t inlined = node.occupied & ~node.solid & ~node.ranked;
    uint rank = count_ones64(inlined & below);
    return word64(node.words, node.odd, NODE_HEADER_WORDS + count_ones64(node.ranked) + 4u * rank);
}

#endif
