// std::thread, mutexes, condition variables and futures on tasks of the run, which change at requests only. They are
// linked into a component and so take precedence over the C++ library's.
#include <pthread.h>
#include <time.h>

#include <condition_variable>
#include <future>
#include <memory>
#include <thread>
#include <unordered_map>

#include "volery/abi.h"

namespace {

constexpr std::int64_t SECOND = 1000000000, ENDLESS = -1;

std::int64_t changes = 0;  // of anything that a task may wait for

// Let the tasks that wait look again.
void wake() noexcept {
    ++changes;
    volery::try_request("wake");
}

// Encode a wait for a change after *seen*, for so many ns at most.
volery::Writer waiting(std::int64_t seen, std::int64_t within) { return volery::Writer().put(seen).put(within); }

std::int64_t now(clockid_t which) {
    timespec time{};
    clock_gettime(which, &time);
    return time.tv_sec * SECOND + time.tv_nsec;
}

// Wait until a point in time at most; return whether it has not come. Does not throw: the C library's functions that
// need it must not. A cancelled task is ended by the framework when it asks again and again.
bool wait_until(clockid_t which, std::int64_t end, std::int64_t seen) noexcept {
    if (end == ENDLESS) {
        volery::try_request("block", waiting(seen, ENDLESS));
        return true;
    }
    auto const left = end - now(which);
    if (left <= 0) return false;
    volery::try_request("block", waiting(seen, left));
    return now(which) < end || changes > seen;
}

// -- mutexes, by their addresses: one that is not locked has no entry

struct Lock {
    const void* owner;
    int depth;
};
std::unordered_map<const void*, Lock>& locks() {
    static auto* all = new std::unordered_map<const void*, Lock>;
    return *all;
}
int waiting_for_locks = 0;

bool try_lock(pthread_mutex_t* mutex) {
    auto const fiber = volery_current_fiber();
    auto const found = locks().find(mutex);
    if (found == locks().end()) {
        locks()[mutex] = {fiber, 1};
        return true;
    }
    bool const recursive = mutex->__data.__kind == PTHREAD_MUTEX_RECURSIVE_NP;
    if (!recursive || found->second.owner != fiber) return false;
    ++found->second.depth;
    return true;
}

void unlock(pthread_mutex_t* mutex) {
    auto const found = locks().find(mutex);
    if (found == locks().end() || --found->second.depth > 0) return;
    locks().erase(found);
    if (waiting_for_locks > 0) wake();
}

int lock(pthread_mutex_t* mutex) noexcept {
    while (!try_lock(mutex)) {
        if (volery_current_fiber() == nullptr) return 0;  // before main() there is one flow of control
        ++waiting_for_locks;
        bool const asked = volery::try_request("block", waiting(changes, ENDLESS));
        --waiting_for_locks;
        if (!asked) return 0;  // cancelled: the task unwinds
    }
    return 0;
}

// -- condition variables, by their addresses: the number of notifications

std::unordered_map<const void*, std::int64_t>& notifications() {
    static auto* all = new std::unordered_map<const void*, std::int64_t>;
    return *all;
}

int notify(const void* condition) noexcept {
    ++notifications()[condition];
    wake();
    return 0;
}

int wait_for_condition(const void* condition, pthread_mutex_t* mutex, clockid_t which, std::int64_t end) noexcept {
    auto const before = notifications()[condition];
    unlock(mutex);
    bool in_time = true;
    while (in_time && notifications()[condition] == before) {
        auto const seen = changes;
        in_time = wait_until(which, end, seen);
        if (end == ENDLESS && changes == seen) break;  // cancelled
    }
    lock(mutex);
    return in_time ? 0 : ETIMEDOUT;
}

std::int64_t nanoseconds(const timespec* time) { return time->tv_sec * SECOND + time->tv_nsec; }

// -- threads: their ids are numbers in the order of their beginning, for addresses differ from run to run

using Id = std::thread::native_handle_type;

Id last_id = 0;
std::unordered_map<const void*, Id>& ids() {  // by the fiber that runs a thread
    static auto* all = new std::unordered_map<const void*, Id>;
    return *all;
}
Id own_id() {
    auto const [found, is_new] = ids().try_emplace(volery_current_fiber(), last_id + 1);
    if (is_new) ++last_id;
    return found->second;
}

struct Run {
    std::unique_ptr<std::thread::_State> state;
    bool ended = false;
};
struct Ending {  // also of a thread that throws
    Run& run;
    ~Ending() {
        run.state.reset();
        run.ended = true;
        wake();
    }
};
std::unordered_map<Id, std::shared_ptr<Run>>& runs() {
    static auto* all = new std::unordered_map<Id, std::shared_ptr<Run>>;
    return *all;
}

}  // namespace

extern "C" {

pthread_t pthread_self() noexcept { return own_id(); }
// What is set about a thread has no effect, and its number is no thread of the C library's.
int pthread_setname_np(pthread_t, const char*) noexcept { return 0; }
int pthread_setschedparam(pthread_t, int, const sched_param*) noexcept { return 0; }
int pthread_getschedparam(pthread_t, int* policy, sched_param* parameters) noexcept {
    *policy = SCHED_OTHER;
    *parameters = {};
    return 0;
}
int pthread_setaffinity_np(pthread_t, std::size_t, const cpu_set_t*) noexcept { return 0; }
int pthread_getcpuclockid(pthread_t, clockid_t* which) noexcept {
    *which = CLOCK_MONOTONIC;
    return 0;
}
int pthread_mutex_lock(pthread_mutex_t* mutex) noexcept { return lock(mutex); }
int pthread_mutex_trylock(pthread_mutex_t* mutex) noexcept { return try_lock(mutex) ? 0 : EBUSY; }
int pthread_mutex_unlock(pthread_mutex_t* mutex) noexcept {
    unlock(mutex);
    return 0;
}
int pthread_mutex_clocklock(pthread_mutex_t* mutex, clockid_t which, const timespec* until) noexcept {
    while (!try_lock(mutex))
        if (!wait_until(which, nanoseconds(until), changes)) return ETIMEDOUT;
    return 0;
}
int pthread_mutex_timedlock(pthread_mutex_t* mutex, const timespec* until) noexcept {
    return pthread_mutex_clocklock(mutex, CLOCK_REALTIME, until);
}
int pthread_cond_signal(pthread_cond_t* condition) noexcept { return notify(condition); }
int pthread_cond_broadcast(pthread_cond_t* condition) noexcept { return notify(condition); }
int pthread_cond_wait(pthread_cond_t* condition, pthread_mutex_t* mutex) {
    return wait_for_condition(condition, mutex, CLOCK_MONOTONIC, ENDLESS);
}
int pthread_cond_timedwait(pthread_cond_t* condition, pthread_mutex_t* mutex, const timespec* until) {
    return wait_for_condition(condition, mutex, CLOCK_REALTIME, nanoseconds(until));
}
int pthread_cond_clockwait(pthread_cond_t* condition, pthread_mutex_t* mutex, clockid_t which, const timespec* until) {
    return wait_for_condition(condition, mutex, which, nanoseconds(until));
}
}

namespace std {

void condition_variable::wait(unique_lock<mutex>& lock) noexcept {
    wait_for_condition(native_handle(), lock.mutex()->native_handle(), CLOCK_MONOTONIC, ENDLESS);
}
void condition_variable::notify_one() noexcept { notify(native_handle()); }
void condition_variable::notify_all() noexcept { notify(native_handle()); }

void thread::_M_start_thread(_State_ptr state, void (*)()) {
    own_id();  // the thread that begins another one is older
    auto const number = ++last_id;
    auto const run = std::make_shared<Run>();
    run->state = std::move(state);
    auto const callable = volery::register_callable([run, number](volery::Reader, volery::Writer&) {
        ids()[volery_current_fiber()] = number;
        Ending const ending{*run};
        run->state->_M_run();
    });
    _M_id = id(number);
    runs()[number] = run;
    volery::request("thread", volery::Writer().put(callable));
}
void thread::join() {
    auto const found = runs().find(_M_id._M_thread);
    if (found == runs().end()) __throw_system_error(EINVAL);
    auto const run = found->second;
    while (!run->ended) volery::request("block", waiting(changes, ENDLESS));
    detach();
}
void thread::detach() {
    if (runs().erase(_M_id._M_thread) == 0) __throw_system_error(EINVAL);
    _M_id = id();
}
unsigned int thread::hardware_concurrency() noexcept { return 4; }  // of a computer on board, whatever this one has

// -- futures

#ifdef _GLIBCXX_HAVE_LINUX_FUTEX
namespace {

bool wait_for_value(const unsigned int* value, unsigned int old, bool limited, clockid_t which, std::int64_t end) {
    while (__atomic_load_n(value, __ATOMIC_ACQUIRE) == old) {
        auto const left = limited ? end - now(which) : ENDLESS;
        if (limited && left <= 0) return false;
        volery::request("block", waiting(changes, left));
    }
    return true;
}

}  // namespace

bool __atomic_futex_unsigned_base::_M_futex_wait_until(unsigned int* value, unsigned int old, bool limited,
                                                       chrono::seconds seconds, chrono::nanoseconds rest) {
    return wait_for_value(value, old, limited, CLOCK_REALTIME, (seconds + rest).count());
}
#if _GLIBCXX_RELEASE >= 11
bool __atomic_futex_unsigned_base::_M_futex_wait_until_steady(unsigned int* value, unsigned int old, bool limited,
                                                              chrono::seconds seconds, chrono::nanoseconds rest) {
    return wait_for_value(value, old, limited, CLOCK_MONOTONIC, (seconds + rest).count());
}
#endif
void __atomic_futex_unsigned_base::_M_futex_notify_all(unsigned int*) { wake(); }
#endif

}  // namespace std
