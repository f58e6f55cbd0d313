/* Times activations on this machine in cycles. The text before this file defines ACTIVATE(), and PREPARE() for the
 * preparation before the first activation.
 *
 * Other code with branches runs between two activations, as on a robot, and evicts the predictor's entries. An
 * activation is compared with dependent additions just before and after it, one a cycle on AArch64 and x86-64.
 * Prints one line per activation: its cycles.
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double now(void) {
    struct timespec time;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return time.tv_sec * 1e9 + time.tv_nsec;
}

static double cycle(void) {
    enum { PASSES = 400, ADDITIONS = 50 };
    uint64_t sum = 3, other = 5;
    double start = now();
    for (int i = 0; i < PASSES; ++i)
        __asm__ volatile(".rept 50\n\t"
#ifdef __aarch64__
                         "add %0, %0, %1\n\t"
#else
                         "add %1, %0\n\t"
#endif
                         ".endr" : "+r"(sum) : "r"(other));
    return (now() - start) / (PASSES * ADDITIONS);
}

static volatile uint64_t kept;

#define ONE(k) if (state & (1ull << (k))) { __asm__ volatile("" : "+r"(sum)); sum += k; }
#define EIGHT(k) ONE(k) ONE(k + 1) ONE(k + 2) ONE(k + 3) ONE(k + 4) ONE(k + 5) ONE(k + 6) ONE(k + 7)

static uint64_t other_code(uint64_t state) {
    uint64_t sum = 0;
    for (int i = 0; i < 3000; ++i) {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        EIGHT(0) EIGHT(8) EIGHT(16) EIGHT(24) EIGHT(32) EIGHT(40) EIGHT(48) EIGHT(56)
    }
    kept = sum;
    return state;
}

int main(int count, char **words) {
    uint64_t state = 88172645463325252ull;
    PREPARE();
    ACTIVATE();
    for (int left = count > 1 ? atoi(words[1]) : 1; left > 0; --left) {
        state = other_code(state);
        double before = cycle(), start = now();
        ACTIVATE();
        double took = now() - start;
        printf("%.1f\n", took / ((before + cycle()) / 2));
    }
}
