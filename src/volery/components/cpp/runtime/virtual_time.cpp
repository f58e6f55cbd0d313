// The C and C++ libraries' clocks and sleeps on the clock of the run. They are linked into a component and so take
// precedence over the C library's. Outside of a fiber (before main) clocks return 0 and sleeps do not wait.
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>

#include "volery/abi.h"

namespace {

constexpr std::int64_t SECOND = 1000000000;

std::int64_t wait(std::int64_t ns) {
    if (volery_current_fiber() != nullptr && ns > 0) volery::request("sleep_ns", volery::Writer().put(ns));
    return 0;
}

// clock_gettime and its siblings are declared not to throw.
std::int64_t read_clock(const char* which) noexcept {
    if (!volery::try_request(which)) return 0;
    std::int64_t value = 0;
    std::memcpy(&value, volery_current_fiber()->reply, sizeof value);
    return value;
}

std::int64_t nanoseconds(const timespec& time) { return time.tv_sec * SECOND + time.tv_nsec; }

std::int64_t read_clock(clockid_t which) noexcept {
    bool const of_day = which == CLOCK_REALTIME || which == CLOCK_REALTIME_COARSE;
    return read_clock(of_day ? "time_of_day" : "monotonic");
}

}  // namespace

extern "C" {

unsigned int sleep(unsigned int seconds) {
    wait(static_cast<std::int64_t>(seconds) * SECOND);
    return 0;
}

int usleep(useconds_t microseconds) { return static_cast<int>(wait(static_cast<std::int64_t>(microseconds) * 1000)); }

int nanosleep(const timespec* wanted, timespec*) { return static_cast<int>(wait(nanoseconds(*wanted))); }

int clock_nanosleep(clockid_t which, int flags, const timespec* wanted, timespec*) {
    std::int64_t const until = nanoseconds(*wanted);
    return static_cast<int>(wait((flags & TIMER_ABSTIME) != 0 ? until - read_clock(which) : until));
}

int clock_gettime(clockid_t which, timespec* result) noexcept {
    std::int64_t const now = read_clock(which);
    *result = {now / SECOND, now % SECOND};
    return 0;
}

int gettimeofday(timeval* result, void*) noexcept {
    std::int64_t const now = read_clock("time_of_day");
    *result = {now / SECOND, now % SECOND / 1000};
    return 0;
}

time_t time(time_t* result) noexcept {
    time_t const now = read_clock("time_of_day") / SECOND;
    if (result != nullptr) *result = now;
    return now;
}

// A component that exits leaves its stack as it is; the run continues.
void exit(int status) noexcept {
    volery::try_request("exit", volery::Writer().put(status));
    std::_Exit(status);
}
}

namespace std::chrono::_V2 {

system_clock::time_point system_clock::now() noexcept {
    return time_point(duration_cast<duration>(nanoseconds(read_clock("time_of_day"))));
}

steady_clock::time_point steady_clock::now() noexcept { return time_point(duration(read_clock("monotonic"))); }

}  // namespace std::chrono::_V2
