/* Searches the number of instructions between two cache misses from which they no longer overlap: ATTEMPTS -> a line
 * for each kind and attempt, its name and the largest number with overlap, 0 where there is no edge.
 */
#define _GNU_SOURCE
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>

typedef struct {
    int count;
    void (*run)(long);
} Probe;

enum { NODE = 256, NODES = 1 << 18, PASSES = 60, ROUNDS = 7 };

static void **first, **second; /* where the two chases are */
static double numbers[8];

#define CHASE(code)                                                                                       \
    double *at = numbers;                                                                                 \
    __asm__ volatile("xor %%eax, %%eax; .balign 64; 2: " code "; dec %2; jnz 2b"                          \
                     : "+S"(first), "+D"(second), "+r"(passes), "+d"(at)::"rax", "rcx", "r8", "r9", "r10", \
                       "r11", "r12", "xmm0", "xmm1", "xmm2", "xmm3", "xmm4", "memory", "cc")

/* PROBES */

static double now(void) {
    struct timespec time;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return time.tv_sec * 1e9 + time.tv_nsec;
}

/* A circle of pointers through memory in random order; the two chases are half of it apart. */
static void lay_out(void) {
    char *memory;
    uint32_t *order = malloc(NODES * sizeof *order);
    uint64_t state = 88172645463325252ull;
    if (!order || posix_memalign((void **)&memory, 2 << 20, (size_t)NODES * NODE))
        exit(1);
    madvise(memory, (size_t)NODES * NODE, MADV_HUGEPAGE);
    for (uint32_t i = 0; i < NODES; ++i)
        order[i] = i;
    for (uint32_t i = NODES - 1; i > 0; --i) {
        state ^= state << 13, state ^= state >> 7, state ^= state << 17;
        uint32_t other = state % (i + 1), moved = order[i];
        order[i] = order[other], order[other] = moved;
    }
    for (uint32_t i = 0; i < NODES; ++i)
        *(void **)(memory + (size_t)order[i] * NODE) = memory + (size_t)order[(i + 1) % NODES] * NODE;
    first = (void **)(memory + (size_t)order[0] * NODE);
    second = (void **)(memory + (size_t)order[NODES / 2] * NODE);
    free(order);
}

static double least(const Probe *one) {
    double best = 1e18;
    for (int round = 0; round < ROUNDS; ++round) {
        double start = now();
        one->run(PASSES);
        double took = (now() - start) / PASSES;
        best = took < best ? took : best;
    }
    return best;
}

/* The largest count whose time is below one and a half times that of the smallest. */
static int edge(const Probe *probes, int count) {
    double limit = 1.5 * least(probes);
    int low = 0, high = count - 1;
    if (least(probes + high) < limit)
        return 0;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (least(probes + middle) < limit)
            low = middle;
        else
            high = middle;
    }
    return low ? probes[low].count : 0;
}

int main(int count, char **words) {
    static const struct {
        const char *name;
        const Probe *probes;
        int count;
    } kinds[] = {KINDS};
    lay_out();
    for (int left = count > 1 ? atoi(words[1]) : 1; left > 0; --left)
        for (size_t i = 0; i < sizeof kinds / sizeof *kinds; ++i)
            printf("%s %d\n", kinds[i].name, edge(kinds[i].probes, kinds[i].count));
}
