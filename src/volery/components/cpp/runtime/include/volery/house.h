// What the two sides of the border share: a flow of control of a component on a stack of its own, and the
// questions that it asks. This file is plain data and functions with C linkage, so that a component may be
// built by another compiler than the runtime. Python mirrors `volery_flow` in flow.py.
#pragma once
#include <cstddef>
#include <cstdint>

extern "C" {

// What the house wants when it lets a flow go on.
enum volery_directive : std::int32_t {
    VOLERY_CALL = 0,    // run the callable, with the reply as its argument
    VOLERY_ANSWER = 1,  // here is the answer to your question
    VOLERY_FAIL = 2,    // your question failed; the reply says why, in words
    VOLERY_END = 3      // your component is ended: leave, running destructors on the way
};

// Answers of `volery_ask` beside the directives above.
enum : std::int32_t { VOLERY_NOBODY = -1 };  // no flow of a component is running on this thread

struct volery_flow {
    const char* question;  // what it asks; a name such as "ros.publish"
    const char* data;      // what goes with the question
    std::uint64_t size;
    std::int32_t cannot_throw;  // the caller is `noexcept`: it cannot be told of an error or of its end
    std::int32_t directive;
    const char* reply;
    std::uint64_t reply_size;
    std::int64_t callable;  // which one VOLERY_CALL is to run
    const char* said;       // whole lines that it has printed since
    std::uint64_t said_size;
};

// Runs one callable and ends with `volery_return`. Each component's library has one.
typedef void (*volery_dispatch)(volery_flow*);

// -- asked by Python
volery_flow* volery_flow_new(const char* component, volery_dispatch dispatch, std::uint64_t stack_bytes);
void volery_resume(volery_flow* flow);  // returns when it asks the next question, or returns from a callable
void volery_supervise(std::int32_t report, double patience_s);

// -- asked by components, through <volery/border.h>
std::int32_t volery_ask(const char* question, const char* data, std::uint64_t size, std::int32_t cannot_throw);
const volery_flow* volery_here(void);  // the flow that is running, null if there is none
void volery_return(volery_flow* flow, const char* how, const char* data, std::uint64_t size);
}
