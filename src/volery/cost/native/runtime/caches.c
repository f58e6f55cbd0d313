/* Model of the caches: which level serves each access of a traced program.
 *
 * VOLERY_CACHES=SIZE/WAYS,...   bytes and ways of each cache, from the first on; lines have 64 bytes
 *
 * Caches are set-associative with least-recently-used replacement. Pages are numbered in the order of their first
 * access, so that the result depends on neither virtual nor physical addresses. A line next to one of the last misses is
 * prefetched: if the second cache or a later one has it, it arrives in time.
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

enum { LINE = 6, PAGE = 12, MOST_CACHES = 4, STREAMS = 16, PREFETCHED = 8 };

void volery_record_access(uint32_t what, uint64_t place);

typedef struct {
    uint64_t sets;
    unsigned ways;
    uint64_t *lines; /* of each set, the most recently used first; 0: empty */
} Cache;

static Cache caches[MOST_CACHES];
static unsigned count;
static uint64_t streams[STREAMS];
static unsigned oldest_stream;

static struct { uint64_t page, number; } *pages;
static uint64_t room, known;

static uint64_t place_of(uint64_t page) {
    uint64_t at = (page * 0x9e3779b97f4a7c15ull >> 20) & (room - 1);
    while (pages[at].number && pages[at].page != page)
        at = (at + 1) & (room - 1);
    return at;
}

static void grow(void) {
    uint64_t before = room;
    __typeof__(pages) old = pages;
    room = before ? 2 * before : 1 << 12;
    pages = calloc(room, sizeof *pages);
    for (uint64_t i = 0; i < before; ++i)
        if (old[i].number)
            pages[place_of(old[i].page)] = old[i];
    free(old);
}

static uint64_t line_of(uint64_t address) {
    if (2 * known >= room)
        grow();
    uint64_t at = place_of(address >> PAGE);
    if (!pages[at].number) {
        pages[at].page = address >> PAGE;
        pages[at].number = ++known;
    }
    return pages[at].number << (PAGE - LINE) | (address >> LINE & ((1u << (PAGE - LINE)) - 1));
}

/* Return whether the cache has the line, and make it the most recently used of its set. */
static int access_line(Cache *cache, uint64_t line) {
    uint64_t *set = cache->lines + line % cache->sets * cache->ways, moved = line;
    for (unsigned way = 0; way < cache->ways; ++way) {
        uint64_t here = set[way];
        set[way] = moved;
        if (here == line)
            return 1;
        moved = here;
    }
    return 0;
}

static int streamed(uint64_t line) {
    for (unsigned i = 0; i < STREAMS; ++i)
        if (line == streams[i] + 1 || line + 1 == streams[i]) {
            streams[i] = line;
            return 1;
        }
    streams[oldest_stream++ % STREAMS] = line;
    return 0;
}

void volery_model_caches(const char *text) {
    for (char *rest; text && *text && count < MOST_CACHES; text = *rest ? rest + 1 : rest) {
        uint64_t size = strtoull(text, &rest, 10);
        Cache *cache = &caches[count++];
        cache->ways = strtoul(rest + 1, &rest, 10);
        cache->sets = size / (cache->ways << LINE);
        cache->lines = calloc(cache->sets * cache->ways, sizeof *cache->lines);
    }
}

__attribute__((constructor)) static void read_caches(void) { volery_model_caches(getenv("VOLERY_CACHES")); }

static unsigned level_of(uint64_t line) {
    unsigned level = 0;
    while (level < count && !access_line(&caches[level], line))
        ++level;
    return level;
}

/* Record an access: which level serves it, and its address with the number of the page in place of the page. `what` is
 * twice the number of the access in the program, plus one for a store. */
void volery_access(const void *address, uint32_t what) {
    uint64_t line = line_of((uintptr_t)address);
    unsigned level = level_of(line), ahead = level && streamed(line) ? PREFETCHED : 0;
    if (ahead && level < count)
        level = ahead = 0;
    uint64_t place = line << LINE | ((uintptr_t)address & ((1u << LINE) - 1));
    volery_record_access(what << 4 | ahead | level, place);
}

/* Access all lines of a range that is copied or filled. */
void volery_range(const void *address, uint64_t length) {
    uint64_t first = (uintptr_t)address >> LINE, last = ((uintptr_t)address + length - 1) >> LINE;
    for (uint64_t line = first; count && length && line <= last; ++line)
        level_of(line_of(line << LINE));
}
