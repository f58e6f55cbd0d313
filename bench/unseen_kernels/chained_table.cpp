// Landmarks by number in a hash table with chains: insert, look up, count sightings, remove the rare ones.
#include <cstdint>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
struct Landmark {
    std::uint32_t number;
    int sightings;
    int next;
};
constexpr int BUCKETS = 1024;
std::vector<std::uint32_t> seen;
std::vector<Landmark> pool;
int heads[BUCKETS];

int bucket_of(std::uint32_t number) { return static_cast<int>((number * 2654435761u) >> 22); }
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    seen.resize(of(input, 3000, 4000, 3500, 5000));
    int different = of(input, 900, 2500, 1500, 1800);
    for (std::uint32_t& one : seen)
        one = static_cast<std::uint32_t>(numbers.below(different)) * 7919u + 13u;
    pool.reserve(8192);
}

double kernel() {
    pool.clear();
    for (int& head : heads)
        head = -1;
    for (std::uint32_t number : seen) {
        int bucket = bucket_of(number), at = heads[bucket];
        while (at >= 0 && pool[at].number != number)
            at = pool[at].next;
        if (at < 0) {
            at = static_cast<int>(pool.size());
            pool.push_back({number, 0, heads[bucket]});
            heads[bucket] = at;
        }
        ++pool[at].sightings;
    }
    int kept = 0;
    long longest = 0;
    for (int& head : heads) {
        int* link = &head;
        long length = 0;
        while (*link >= 0) {
            if (pool[*link].sightings < 2) {
                *link = pool[*link].next;
            } else {
                ++kept;
                ++length;
                link = &pool[*link].next;
            }
        }
        longest = length > longest ? length : longest;
    }
    return kept * 100.0 + longest;
}
