/* Runtime of an instrumented program: writes its counters or its trace when it ends.
 *
 * VOLERY_COUNTS=FILE   counters at the end, less those at the beginning (64 bits each)
 * VOLERY_TRACE=FILE    numbers of blocks entered (32 bits each): the first VOLERY_WINDOW of every VOLERY_STRIDE,
 *                      and between them the values that switches used (the greatest bit is set) and the accesses to
 *                      memory (the second greatest is), of two words each: what and where, see caches.c
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/personality.h>
#include <unistd.h>

extern uint64_t volery_counters[] __attribute__((weak));
extern const uint64_t volery_counters_length __attribute__((weak));

enum { BUFFERED = 1 << 14 };

static uint64_t *before;
static FILE *trace;
static uint32_t buffer[BUFFERED];
static uint64_t entered, window, stride;
static unsigned used;

static uint64_t number(const char *name, uint64_t otherwise) {
    const char *text = getenv(name);
    return text ? strtoull(text, NULL, 10) : otherwise;
}

static void flush(void) {
    fwrite(buffer, sizeof *buffer, used, trace);
    used = 0;
}

static void append(uint32_t record) {
    buffer[used++] = record;
    if (used == BUFFERED)
        flush();
}

static int in_window(void) {
    return trace && entered && (entered - 1) % stride < window;
}

void volery_trace(uint32_t block) {
    if (trace && entered++ % stride < window)
        append(block);
}

void volery_switch(uint32_t value) {
    if (in_window())
        append(value | 1u << 31);
}

void volery_record_access(uint32_t what, uint64_t place) {
    if (!in_window())
        return;
    append((what & ~(3u << 30)) | 1u << 30);
    append((place & ~(3u << 30)) | 1u << 30);
}

/* Begin a trace of code that is loaded by another program. */
void volery_trace_into(const char *name, uint64_t blocks, uint64_t of_blocks) {
    window = blocks;
    stride = of_blocks;
    trace = fopen(name, "wb");
}

/* Restart the program at the same addresses as in every run, if the system allows it: its caches then miss at
 * the same accesses. */
void volery_fix_addresses(char **arguments) {
    int now = personality(0xffffffff);
    if (now != -1 && !(now & ADDR_NO_RANDOMIZE) && personality(now | ADDR_NO_RANDOMIZE) != -1)
        execv("/proc/self/exe", arguments);
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
