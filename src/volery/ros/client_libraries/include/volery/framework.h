// Shared by both sides of the framework ABI: a fiber of a component and the requests that it makes.
//
// Plain data and functions with C linkage only, so that a component may be built by another compiler than the
// runtime. Python mirrors `volery_fiber` in volery/components/cpp/framework.py. The functions are defined in
// volery/components/cpp/runtime/framework.cpp; the header stands here because client libraries include it.
#pragma once
#include <cstddef>
#include <cstdint>

extern "C" {

// What a fiber does when it is resumed.
enum volery_directive : std::int32_t {
    VOLERY_CALL = 0,    // run a callable with the reply as its argument
    VOLERY_REPLY = 1,   // the request succeeded; its result is the reply
    VOLERY_FAIL = 2,    // the request failed; the reply is the error text
    VOLERY_CANCEL = 3   // the component is cancelled: unwind the stack, running destructors
};

// Result of `volery_request` beside the directives above.
enum : std::int32_t { VOLERY_NO_FIBER = -1 };  // no fiber of a component is running on this thread

struct volery_fiber {
    const char* request;  // name of the request, such as "ros.publish"
    const char* data;     // its encoded arguments
    std::uint64_t size;
    std::int32_t cannot_throw;  // the caller is `noexcept`: neither an error nor a cancellation can be raised
    std::int32_t directive;
    const char* reply;
    std::uint64_t reply_size;
    std::int64_t callable;  // number of the callable that VOLERY_CALL runs
    const char* output;     // complete lines that the code has printed since the last request
    std::uint64_t output_size;
};

// Run one callable and end with `volery_return`. Each component's library has one.
typedef void (*volery_dispatch)(volery_fiber*);

// -- called by Python
volery_fiber* volery_fiber_new(const char* component, volery_dispatch dispatch, std::uint64_t stack_bytes);
void volery_resume(volery_fiber* fiber);  // returns at the fiber's next request or at the end of a callable
void volery_supervise(std::int32_t report, double patience_s);

// -- called by components through <volery/abi.h>
std::int32_t volery_request(const char* name, const char* data, std::uint64_t size, std::int32_t cannot_throw);
const volery_fiber* volery_current_fiber(void);  // the running fiber, null if there is none
void volery_return(volery_fiber* fiber, const char* outcome, const char* data, std::uint64_t size);
}
