/* Times loops of snippets against a loop of single cycles, alternately: NAME REPETITIONS... -> a line per round.
 *
 * A line: the name, nanoseconds of one pass of the snippets, of one of the single cycles (both of process time).
 * The loops of snippets (tick among them), the table CASES and the sizes of memory are generated before this file.
 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static double now(void) {
    struct timespec time;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return time.tv_sec * 1e9 + time.tv_nsec;
}

static uint64_t mixed(uint64_t x) {
    x ^= x << 13;
    x ^= x >> 7;
    return x ^ x << 17;
}

/* One branch that is taken by the lowest bit: at random, or never. No call repeats the numbers of one before:
 * large predictors learn thousands of them. */
static void branches(long passes, uint64_t mask) {
    static uint64_t state = 88172645463325252ull;
    volatile long sink = 0;
    long taken = 0;
    for (long pass = 0; pass < passes; ++pass) {
        state = mixed(state);
        uint64_t bits = state & mask;
        for (int i = 0; i < 64; ++i, bits >>= 1)
            BRANCH_IF_ODD(bits, taken);
    }
    sink = taken;
    (void)sink;
}

static void branches_random(long passes) { branches(passes, ~0ull); }
static void branches_never(long passes) { branches(passes, 0); }

/* Sixty-four computed jumps a pass, all to one target or to eight in an order that is easy to predict. */
static void jumps(long passes, const unsigned char *order) {
    static const void *const places[] = {&&a, &&b, &&c, &&d, &&e, &&f, &&g, &&h};
    volatile long sink = 0;
    long sum = 0, left = passes * 64;
    while (left-- > 0) {
        goto *places[order[left & 15]];
    a: sum += 1; continue;
    b: sum += 3; continue;
    c: sum += 5; continue;
    d: sum += 7; continue;
    e: sum ^= 9; continue;
    f: sum ^= 11; continue;
    g: sum ^= 13; continue;
    h: sum ^= 15; continue;
    }
    sink = sum;
    (void)sink;
}

static void jumps_one(long passes) {
    static const unsigned char order[16] = {0};
    jumps(passes, order);
}

static void jumps_many(long passes) {
    static const unsigned char order[16] = {3, 0, 6, 1, 7, 2, 2, 5, 4, 0, 3, 7, 1, 6, 5, 4};
    jumps(passes, order);
}

/* Sixty-four dependent loads a pass, along a circular list of lines in random order. */
enum { LINE = 64, EACH = LINE / sizeof(uint32_t) };

static uint32_t *circle_of(uint32_t lines) {
    uint32_t *order = malloc(lines * sizeof *order), *circle = aligned_alloc(LINE, (size_t)lines * LINE);
    uint64_t state = 88172645463325252ull;
    for (uint32_t i = 0; i < lines; ++i)
        order[i] = i;
    for (uint32_t i = lines - 1; i > 0; --i) {
        state = mixed(state);
        uint32_t other = state % (i + 1), moved = order[i];
        order[i] = order[other];
        order[other] = moved;
    }
    for (uint32_t i = 0; i < lines; ++i)
        circle[(size_t)order[i] * EACH] = order[(i + 1) % lines];
    free(order);
    return circle;
}

static void go_round(long passes, size_t bytes) {
    static uint32_t *circle, left;
    if (!circle)
        circle = circle_of(bytes / LINE);
    uint32_t at = left;
    for (long pass = 0; pass < passes; ++pass)
        for (int i = 0; i < 64; ++i)
            at = circle[(size_t)at * EACH];
    left = at;
}

/* Sixty-four consecutive lines. */
static void in_a_row(long passes, size_t bytes) {
    static double *numbers;
    static size_t at;
    static volatile double sink;
    size_t length = bytes / sizeof *numbers;
    if (!numbers) {
        numbers = aligned_alloc(LINE, bytes);
        for (size_t i = 0; i < length; ++i)
            numbers[i] = i;
    }
    double sum = 0.0;
    for (long pass = 0; pass < passes; ++pass) {
        at = at + 2 * 64 * 8 > length ? 0 : at + 64 * 8;
        for (const double *line = numbers + at; line < numbers + at + 64 * 8; line += 8)
            sum += *line;
    }
    sink = sum;
}

static void memory_second(long passes) { go_round(passes, IN_SECOND); }
static void memory_third(long passes) { go_round(passes, IN_THIRD); }
static void memory_behind(long passes) { go_round(passes, BEHIND); }
static void memory_row(long passes) { in_a_row(passes, BEHIND); }

static double arguments[64], others[64];
static char text[64][32], copied[256], source[256];
static volatile double total;
static void *volatile held;
double results[64];

/* No call waits for the result of another: a sum would go through memory at each call. */
#define LIBRARY(name, call)                             \
    static void library_##name(long passes) {           \
        for (long pass = 0; pass < passes; ++pass)      \
            for (int i = 0; i < 64; ++i)                \
                results[i] = call;                      \
    }
#define X arguments[i]
#define Y others[i]
#include "library.h"
#undef LIBRARY
#undef X

/* The same calls, the argument of each after the result of the one before. */
static volatile double nothing;
#define LIBRARY(name, call)                             \
    static void delay_##name(long passes) {             \
        double sum = 0.0, none = nothing;               \
        for (long pass = 0; pass < passes; ++pass)      \
            for (int i = 0; i < 64; ++i)                \
                sum = call;                             \
        total = sum;                                    \
    }
#define X (arguments[i] + none * sum)
#include "library.h"

typedef struct {
    const char *name;
    void (*run)(long);
} Case;

static const Case cases[] = {CASES{"branches_random", branches_random}, {"branches_never", branches_never},
                             {"jumps_one", jumps_one}, {"jumps_many", jumps_many},
                             {"memory_second", memory_second}, {"memory_third", memory_third},
                             {"memory_behind", memory_behind}, {"memory_row", memory_row}};

static double timed(void (*run)(long), long passes) {
    double start = now();
    run(passes);
    return (now() - start) / passes;
}

int main(int count, char **words) {
    for (int i = 0; i < 64; ++i) {
        arguments[i] = 0.02 + 0.0456 * i;
        others[i] = 1.7 - 0.03 * i;
        snprintf(text[i], sizeof text[i], "%.6f", arguments[i]);
    }
    memset(source, 'x', sizeof source - 1);
    for (int word = 1; word + 1 < count; word += 2)
        for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
            if (strcmp(cases[i].name, words[word]) != 0)
                continue;
            long passes = 1;
            cases[i].run(passes); /* the set-up is not timed */
            while (timed(cases[i].run, passes) * passes < 50e3)
                passes *= 2;
            for (int round = atoi(words[word + 1]); round > 0; --round) {
                double before = timed(tick, 20), took = timed(cases[i].run, passes), after = timed(tick, 20);
                printf("%s %.6f %.6f\n", cases[i].name, took, (before + after) / 2);
            }
        }
}
