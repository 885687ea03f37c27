// Pages of volumes that are not on the device as a whole. A ray marks each page that it asks for. Where the page is not here, what the
// invocation finds from then on means nothing: it stores nothing, and the host launches it again once the page is here (src/pages.rs).
#ifndef PAGES_GLSL
#define PAGES_GLSL

#include "layout.glsl"
#include "needs.glsl"

// Whether this invocation has asked for a page that is not here.
bool page_missed = false;

bool lacks_a_page() {
    return NEEDS_PAGES != 0u && page_missed;
}

bool is_paged(InstanceRef instance) {
    return NEEDS_PAGES != 0u && instance.it.page_marks != 0UL;
}

// Whether the bricks of a block are on the device. Marks their page.
bool is_here(InstanceRef instance, BrickBlock block) {
    if (!is_paged(instance)) {
        return true;
    }
    Words marks = Words(instance.it.page_marks);
    uint word = block.page >> 5, bit = 1u << (block.page & 31u);
    // (Most marks are there already, and reading costs less than an atomic operation.)
    if ((marks.at[word] & bit) == 0u) {
        atomicOr(marks.at[word], bit);
    }
    bool here = block.first_brick != NONE;
    page_missed = page_missed || !here;
    return here;
}

// Adds to one of the counts before the marks.
void count_for_pages(Address requests, uint place, uint count) {
    if (count > 0u) {
        atomicAdd(Words(requests).at[place], count);
    }
}

const uint PAGES_LACKED = 0u;
const uint PAGES_SAMPLES = 1u;

#endif
