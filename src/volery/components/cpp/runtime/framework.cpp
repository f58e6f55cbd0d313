// Fibers: flows of control with stacks of their own. This part of the framework ABI is shared by all components.
//
// Python calls `volery_resume`, which switches to the fiber's stack. There the component calls `volery_request`,
// which switches back. So no Python frame is ever above a C++ frame, and the stack of a waiting fiber never moves.
#include "volery/framework.h"

#include <cxxabi.h>
#include <dlfcn.h>
#include <execinfo.h>
#include <pthread.h>
#include <sys/mman.h>
#include <ucontext.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <initializer_list>
#include <iostream>
#include <streambuf>
#include <string>

namespace {

// The Itanium ABI's record of a thread's exceptions. Each fiber has its own, as each thread would.
struct Exceptions {
    void* caught;
    unsigned int uncaught;
};

struct Fiber : volery_fiber {
    ucontext_t inside, outside;
    Exceptions exceptions;
    volery_dispatch dispatch;
    char* memory;  // the guard pages, then the stack
    char component[128];
    std::string printed;
};

Fiber* volatile running = nullptr;
Fiber* last = nullptr;               // the fiber that ran most recently
volatile std::uint64_t resumed = 0;  // number of resumptions of all fibers
pthread_t owner;                     // the only thread that fibers run on
constexpr std::size_t GUARD_BYTES = 1 << 20;  // more than the local variables of a function should take

void exchange_exceptions(Fiber* fiber) {
    auto* current = reinterpret_cast<Exceptions*>(abi::__cxa_get_globals());
    Exceptions const saved = *current;
    *current = fiber->exceptions;
    fiber->exceptions = saved;
}

// Switch to Python and hand over the first `output_size` bytes that the fiber has printed.
void suspend(Fiber* fiber, std::size_t output_size) {
    fiber->output = fiber->printed.data();
    fiber->output_size = output_size;
    exchange_exceptions(fiber);
    running = nullptr;
    swapcontext(&fiber->inside, &fiber->outside);
    fiber->printed.erase(0, output_size);
}

// Return the size of the complete lines that the fiber has printed.
std::size_t complete_lines(const Fiber* fiber) {
    auto const end = fiber->printed.rfind('\n');
    return end == std::string::npos ? 0 : end + 1;
}

// The bottom frame of each stack: runs one callable after the other.
void fiber_main(unsigned int high, unsigned int low) {
    auto* fiber = reinterpret_cast<Fiber*>((static_cast<std::uintptr_t>(high) << 32) | low);
    for (;;) fiber->dispatch(fiber);
}

}  // namespace

// A fiber lives as long as the process, since a cancelled component may leave its stack in any state.
volery_fiber* volery_fiber_new(const char* component, volery_dispatch dispatch, std::uint64_t stack_bytes) {
    std::size_t const bytes = GUARD_BYTES + stack_bytes;
    int const flags = MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE | MAP_STACK;
    void* memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, flags, -1, 0);
    if (memory == MAP_FAILED) return nullptr;
    mprotect(memory, GUARD_BYTES, PROT_NONE);
    auto* fiber = new Fiber{};
    fiber->dispatch = dispatch;
    fiber->memory = static_cast<char*>(memory);
    std::snprintf(fiber->component, sizeof fiber->component, "%s", component);
    getcontext(&fiber->inside);
    fiber->inside.uc_stack.ss_sp = fiber->memory + GUARD_BYTES;
    fiber->inside.uc_stack.ss_size = stack_bytes;
    fiber->inside.uc_link = nullptr;
    auto const address = reinterpret_cast<std::uintptr_t>(fiber);
    makecontext(&fiber->inside, reinterpret_cast<void (*)()>(fiber_main), 2, static_cast<unsigned int>(address >> 32),
                static_cast<unsigned int>(address));
    return fiber;
}

void volery_resume(volery_fiber* which) {
    auto* fiber = static_cast<Fiber*>(which);
    resumed = resumed + 1;
    owner = pthread_self();
    last = fiber;
    exchange_exceptions(fiber);
    running = fiber;
    swapcontext(&fiber->outside, &fiber->inside);
}

const volery_fiber* volery_current_fiber() { return running; }

std::int32_t volery_request(const char* name, const char* data, std::uint64_t size, std::int32_t cannot_throw) {
    Fiber* fiber = running;
    if (fiber == nullptr || !pthread_equal(pthread_self(), owner)) return VOLERY_NO_FIBER;
    fiber->request = name;
    fiber->data = data;
    fiber->size = size;
    fiber->cannot_throw = cannot_throw;
    suspend(fiber, fiber->printed.empty() ? 0 : complete_lines(fiber));
    while (fiber->directive == VOLERY_CALL) fiber->dispatch(fiber);
    return fiber->directive;
}

void volery_return(volery_fiber* which, const char* outcome, const char* data, std::uint64_t size) {
    auto* fiber = static_cast<Fiber*>(which);
    fiber->request = outcome;
    fiber->data = data;
    fiber->size = size;
    suspend(fiber, fiber->printed.size());
}

// -- fatal errors of a component. The report goes to the supervising process.

namespace {

constexpr unsigned int TICKS = 4;  // checks within the allowed time without a request
constexpr int FRAMES = 64;
int report_to = -1;

// Write one line and end the process: the component, what happened, the address, the stack frames in its library
// (innermost first) and the output that was not yet handed over.
void report(const char* what, const void* address, const void* counter) {
    char line[2048];
    int size = std::snprintf(line, sizeof line, "%s\t%s\t%p\t", last->component, what, address);
    Dl_info library{};
    dladdr(reinterpret_cast<void*>(last->dispatch), &library);
    void* frames[FRAMES];
    int const count = backtrace(frames, FRAMES);
    for (int index = 0; index < count && size < static_cast<int>(sizeof line) - 32; ++index) {
        Dl_info place{};
        if (dladdr(frames[index], &place) == 0 || place.dli_fbase != library.dli_fbase) continue;
        auto const offset = static_cast<char*>(frames[index]) - static_cast<char*>(place.dli_fbase);
        long const of_call = offset - (frames[index] == counter ? 0 : 1);
        size += std::snprintf(line + size, sizeof line - static_cast<std::size_t>(size), "%lx ", of_call);
    }
    line[size++] = '\t';
    for (char const letter : last->printed)
        if (size < static_cast<int>(sizeof line) - 1) line[size++] = letter < ' ' ? ' ' : letter;
    line[size++] = '\n';
    if (write(report_to, line, static_cast<std::size_t>(size)) < 0) _exit(3);
    _exit(2);
}

const void* program_counter(void* context) {
    auto* machine = &static_cast<ucontext_t*>(context)->uc_mcontext;
#if defined(__x86_64__)
    return reinterpret_cast<void*>(machine->gregs[REG_RIP]);
#elif defined(__aarch64__)
    return reinterpret_cast<void*>(machine->pc);
#else
    return nullptr;
#endif
}

void crashed(int signal, siginfo_t* info, void* context) {
    Fiber* const fiber = running;
    if (last == nullptr || (fiber == nullptr && pthread_equal(pthread_self(), owner))) {
        std::signal(signal, SIG_DFL);  // not caused by a component: take the default action
        raise(signal);
        return;
    }
    auto const* address = static_cast<const char*>(info->si_addr);
    bool const overflow = fiber != nullptr && signal == SIGSEGV && address >= fiber->memory && address < fiber->memory + GUARD_BYTES;
    char name[16];
    std::snprintf(name, sizeof name, "%d", signal);
    report(overflow ? "stack" : name, address, program_counter(context));
}

// Periodic check: report a fiber that has run for too long without a request.
void check_progress(int, siginfo_t*, void* context) {
    if (last != nullptr && !pthread_equal(pthread_self(), owner)) {
        pthread_kill(owner, SIGALRM);
        return;
    }
    static std::uint64_t seen = 0;
    static unsigned int ticks = 0;
    if (running == nullptr || resumed != seen) {
        seen = resumed;
        ticks = 0;
    } else if (++ticks > TICKS) {
        report("frozen", nullptr, program_counter(context));
    }
}

void handle(int signal, void (*handler)(int, siginfo_t*, void*), int flags) {
    struct sigaction action {};
    action.sa_sigaction = handler;
    action.sa_flags = SA_SIGINFO | SA_ONSTACK | flags;
    sigemptyset(&action.sa_mask);
    sigaction(signal, &action, nullptr);
}

}  // namespace

// -- standard output and standard error of components

namespace {

ssize_t print(void*, const char* text, std::size_t size) {
    if (running == nullptr) return write(STDERR_FILENO, text, size);
    running->printed.append(text, size);
    return static_cast<ssize_t>(size);
}

class CapturedOutput : public std::streambuf {
protected:
    int overflow(int letter) override {
        char const one = static_cast<char>(letter);
        if (letter != traits_type::eof()) print(nullptr, &one, 1);
        return traits_type::not_eof(letter);
    }
    std::streamsize xsputn(const char* text, std::streamsize size) override {
        return print(nullptr, text, static_cast<std::size_t>(size));
    }
};

void capture_output() {
    static CapturedOutput captured;
    for (std::ostream* stream : {&std::cout, &std::cerr, &std::clog}) stream->rdbuf(&captured);
    for (FILE** stream : {&stdout, &stderr}) {
        cookie_io_functions_t functions{};
        functions.write = print;
        FILE* ours = fopencookie(nullptr, "w", functions);
        if (ours == nullptr) continue;
        std::setvbuf(ours, nullptr, _IONBF, 0);
        *stream = ours;
    }
}

}  // namespace

void volery_supervise(std::int32_t to, double patience_s) {
    capture_output();
    report_to = to;
    void* frame = nullptr;
    backtrace(&frame, 1);  // loads libgcc now, which must not happen in a signal handler
    static char emergency[65536];  // stack of the signal handlers: the component's may have overflowed
    stack_t stack{};
    stack.ss_sp = emergency;
    stack.ss_size = sizeof emergency;
    sigaltstack(&stack, nullptr);
    for (int const signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT}) handle(signal, crashed, 0);
    handle(SIGALRM, check_progress, SA_RESTART);
    long const period_ns = static_cast<long>(patience_s * 1e9 / TICKS);
    struct sigevent event {};
    event.sigev_notify = SIGEV_SIGNAL;
    event.sigev_signo = SIGALRM;
    struct itimerspec every {};
    every.it_value.tv_sec = every.it_interval.tv_sec = period_ns / 1000000000;
    every.it_value.tv_nsec = every.it_interval.tv_nsec = period_ns % 1000000000;
    timer_t timer;
    if (timer_create(CLOCK_MONOTONIC, &event, &timer) == 0) timer_settime(timer, 0, &every, nullptr);
}
