/* Beside an instrumented program: writes what it counted, or which blocks it entered, when it ends.
 *
 * VOLERY_COUNTS=FILE   counters at the end, less those at the beginning (64 bits each)
 * VOLERY_TRACE=FILE    numbers of blocks entered (32 bits each): the first VOLERY_WINDOW of every VOLERY_STRIDE,
 *                      and between them the values that switches used (the greatest bit is set) and the accesses to
 *                      memory that the first cache did not serve (the second greatest is; see caches.c)
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

extern uint64_t volery_counters[] __attribute__((weak));
extern const uint64_t volery_counters_length __attribute__((weak));

enum { HELD = 1 << 14 };

static uint64_t *before;
static FILE *trace;
static uint32_t held[HELD];
static uint64_t entered, window, stride;
static unsigned holds;

static uint64_t number(const char *name, uint64_t otherwise) {
    const char *text = getenv(name);
    return text ? strtoull(text, NULL, 10) : otherwise;
}

static void flush(void) {
    fwrite(held, sizeof *held, holds, trace);
    holds = 0;
}

static void hold(uint32_t told) {
    held[holds++] = told;
    if (holds == HELD)
        flush();
}

static int is_seen(void) {
    return trace && entered && (entered - 1) % stride < window;
}

void volery_trace(uint32_t block) {
    if (trace && entered++ % stride < window)
        hold(block);
}

void volery_switch(uint32_t value) {
    if (is_seen())
        hold(value | 1u << 31);
}

void volery_tell_access(uint32_t what) {
    if (is_seen())
        hold(what | 1u << 30);
}

/* The same for code that is loaded by another program. */
void volery_trace_into(const char *name, uint64_t of_each, uint64_t so_many) {
    window = of_each;
    stride = so_many;
    trace = fopen(name, "wb");
}

void volery_begin(void) {
    if (getenv("VOLERY_COUNTS") && &volery_counters_length) {
        before = malloc(volery_counters_length * sizeof *before);
        memcpy(before, volery_counters, volery_counters_length * sizeof *before);
    }
    const char *name = getenv("VOLERY_TRACE");
    if (name)
        volery_trace_into(name, number("VOLERY_WINDOW", 1), number("VOLERY_STRIDE", 1));
}

void volery_end(void) {
    if (trace) {
        flush();
        fclose(trace);
        trace = NULL;
    }
    const char *name = getenv("VOLERY_COUNTS");
    FILE *out = before && name ? fopen(name, "wb") : NULL;
    if (!out)
        return;
    for (uint64_t i = 0; i < volery_counters_length; ++i) {
        uint64_t counted = volery_counters[i] - before[i];
        fwrite(&counted, sizeof counted, 1, out);
    }
    fclose(out);
}
