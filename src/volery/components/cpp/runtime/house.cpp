// Flows of control with stacks of their own: the part of the border that is the same for every component.
//
// `volery_resume` is called by Python and switches to the flow's stack; `volery_ask` is called there and
// switches back. So no Python frame is ever above a C++ frame, and a flow that waits stays exactly as it is.
#include "volery/house.h"

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

// The Itanium ABI's record of a thread's exceptions. Each flow has its own, as each thread would.
struct Exceptions {
    void* caught;
    unsigned int uncaught;
};

struct Flow : volery_flow {
    ucontext_t inside, outside;
    Exceptions exceptions;
    volery_dispatch dispatch;
    char* memory;  // the guard, then the stack
    char component[128];
    std::string printed;
};

Flow* volatile running = nullptr;
Flow* last = nullptr;                // the one that ran most recently
volatile std::uint64_t resumed = 0;  // how often any flow has been let go on
pthread_t owner;                     // the one thread that flows run on
constexpr std::size_t GUARD_BYTES = 1 << 20;  // more than a function's local variables should take

void exchange_exceptions(Flow* flow) {
    auto* current = reinterpret_cast<Exceptions*>(abi::__cxa_get_globals());
    Exceptions const theirs = *current;
    *current = flow->exceptions;
    flow->exceptions = theirs;
}

void leave(Flow* flow, std::size_t told) {
    flow->said = flow->printed.data();
    flow->said_size = told;
    exchange_exceptions(flow);
    running = nullptr;
    swapcontext(&flow->inside, &flow->outside);
    flow->printed.erase(0, told);
}

// What of its printed text is whole lines.
std::size_t whole_lines(const Flow* flow) {
    auto const end = flow->printed.rfind('\n');
    return end == std::string::npos ? 0 : end + 1;
}

// What runs at the bottom of each stack: callables, one after the other.
void body(unsigned int high, unsigned int low) {
    auto* flow = reinterpret_cast<Flow*>((static_cast<std::uintptr_t>(high) << 32) | low);
    for (;;) flow->dispatch(flow);
}

}  // namespace

// It lives as long as the process: code may be left in the middle of anything.
volery_flow* volery_flow_new(const char* component, volery_dispatch dispatch, std::uint64_t stack_bytes) {
    std::size_t const bytes = GUARD_BYTES + stack_bytes;
    int const flags = MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE | MAP_STACK;
    void* memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, flags, -1, 0);
    if (memory == MAP_FAILED) return nullptr;
    mprotect(memory, GUARD_BYTES, PROT_NONE);
    auto* flow = new Flow{};
    flow->dispatch = dispatch;
    flow->memory = static_cast<char*>(memory);
    std::snprintf(flow->component, sizeof flow->component, "%s", component);
    getcontext(&flow->inside);
    flow->inside.uc_stack.ss_sp = flow->memory + GUARD_BYTES;
    flow->inside.uc_stack.ss_size = stack_bytes;
    flow->inside.uc_link = nullptr;
    auto const address = reinterpret_cast<std::uintptr_t>(flow);
    makecontext(&flow->inside, reinterpret_cast<void (*)()>(body), 2, static_cast<unsigned int>(address >> 32),
                static_cast<unsigned int>(address));
    return flow;
}

void volery_resume(volery_flow* which) {
    auto* flow = static_cast<Flow*>(which);
    resumed = resumed + 1;
    owner = pthread_self();
    last = flow;
    exchange_exceptions(flow);
    running = flow;
    swapcontext(&flow->outside, &flow->inside);
}

const volery_flow* volery_here() { return running; }

std::int32_t volery_ask(const char* question, const char* data, std::uint64_t size, std::int32_t cannot_throw) {
    Flow* flow = running;
    if (flow == nullptr || !pthread_equal(pthread_self(), owner)) return VOLERY_NOBODY;
    flow->question = question;
    flow->data = data;
    flow->size = size;
    flow->cannot_throw = cannot_throw;
    leave(flow, flow->printed.empty() ? 0 : whole_lines(flow));
    while (flow->directive == VOLERY_CALL) flow->dispatch(flow);
    return flow->directive;
}

void volery_return(volery_flow* which, const char* how, const char* data, std::uint64_t size) {
    auto* flow = static_cast<Flow*>(which);
    flow->question = how;
    flow->data = data;
    flow->size = size;
    leave(flow, flow->printed.size());
}

// -- what a component does that no program survives. The report goes to the supervising process.

namespace {

constexpr unsigned int TICKS = 4;  // looks within the patience
constexpr int FRAMES = 64;
int report_to = -1;

// One line: whose doing, what, at which address, where in its library the code stood (innermost frame first), and
// what it printed last. Nothing of this process goes on.
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
    Flow* const flow = running;
    if (last == nullptr || (flow == nullptr && pthread_equal(pthread_self(), owner))) {
        std::signal(signal, SIG_DFL);  // not a component's doing: die as one usually does
        raise(signal);
        return;
    }
    auto const* address = static_cast<const char*>(info->si_addr);
    bool const full = flow != nullptr && signal == SIGSEGV && address >= flow->memory && address < flow->memory + GUARD_BYTES;
    char name[16];
    std::snprintf(name, sizeof name, "%d", signal);
    report(full ? "stack" : name, address, program_counter(context));
}

// Now and then: a flow that runs and has not asked anything for too long will not ask any more.
void looked(int, siginfo_t*, void* context) {
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

// -- what components print

namespace {

ssize_t print(void*, const char* text, std::size_t size) {
    if (running == nullptr) return write(STDERR_FILENO, text, size);
    running->printed.append(text, size);
    return static_cast<ssize_t>(size);
}

class Printed : public std::streambuf {
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

void take_over_printing() {
    static Printed printed;
    for (std::ostream* stream : {&std::cout, &std::cerr, &std::clog}) stream->rdbuf(&printed);
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
    take_over_printing();
    report_to = to;
    void* frame = nullptr;
    backtrace(&frame, 1);  // loads what it needs, which must not happen in a handler
    static char emergency[65536];  // a handler's own stack: the component's may be full
    stack_t stack{};
    stack.ss_sp = emergency;
    stack.ss_size = sizeof emergency;
    sigaltstack(&stack, nullptr);
    for (int const signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT}) handle(signal, crashed, 0);
    handle(SIGALRM, looked, SA_RESTART);
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
