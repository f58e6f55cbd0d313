// Time of the machine, on the clock of the run: these are linked into a component and so come before the C
// library's. Outside of a flow of control (before main) they say 0 and do not wait.
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>

#include "volery/border.h"

namespace {

constexpr std::int64_t SECOND = 1000000000;

std::int64_t wait(std::int64_t ns) {
    if (volery_here() != nullptr && ns > 0) volery::ask("sleep_ns", volery::Writer().put(ns));
    return 0;
}

// clock_gettime and its like are declared not to throw.
std::int64_t read_clock(const char* which) noexcept {
    if (!volery::tell(which)) return 0;
    std::int64_t value = 0;
    std::memcpy(&value, volery_here()->reply, sizeof value);
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

int clock_gettime(clockid_t which, timespec* told) noexcept {
    std::int64_t const now = read_clock(which);
    *told = {now / SECOND, now % SECOND};
    return 0;
}

int gettimeofday(timeval* told, void*) noexcept {
    std::int64_t const now = read_clock("time_of_day");
    *told = {now / SECOND, now % SECOND / 1000};
    return 0;
}

time_t time(time_t* told) noexcept {
    time_t const now = read_clock("time_of_day") / SECOND;
    if (told != nullptr) *told = now;
    return now;
}

// A component that exits leaves everything as it stands; the run goes on.
void exit(int status) noexcept {
    volery::tell("exit", volery::Writer().put(status));
    std::_Exit(status);
}
}

namespace std::chrono::_V2 {

system_clock::time_point system_clock::now() noexcept {
    return time_point(duration_cast<duration>(nanoseconds(read_clock("time_of_day"))));
}

steady_clock::time_point steady_clock::now() noexcept { return time_point(duration(read_clock("monotonic"))); }

}  // namespace std::chrono::_V2
