// The part of the framework ABI that is linked into each component's library: its callables and requests.
#include <cxxabi.h>

#include <cstdlib>
#include <memory>
#include <typeinfo>

#include "volery/abi.h"

namespace volery {
namespace {

struct Callables {
    std::unordered_map<std::int64_t, std::shared_ptr<Callable>> by_number;
    std::int64_t next = FREE;
};

// Never destroyed: destructors of other static objects may still unregister callables when the program ends.
Callables& callables() {
    static auto* all = new Callables;
    return *all;
}

std::string type_of_current_exception() {
    const std::type_info* type = abi::__cxa_current_exception_type();
    if (type == nullptr) return "something unknown";
    int failed = 0;
    std::unique_ptr<char, void (*)(void*)> name(abi::__cxa_demangle(type->name(), nullptr, nullptr, &failed),
                                                std::free);
    return failed ? type->name() : name.get();
}

// Run a callable; return how it ended. `result` holds what it returned, or the type and text of its exception.
const char* run(std::int64_t number, Reader argument, Writer& result) {
    try {
        auto found = callables().by_number.find(number);
        if (found == callables().by_number.end()) throw std::logic_error("no callable has this number");
        auto const callable = found->second;  // it may unregister itself while it runs
        (*callable)(argument, result);
        return "returned";
    } catch (const Cancelled&) {
        return "cancelled";
    } catch (const Error& error) {
        result = Writer().put("volery::Error").put(error.what());
        return "failed";
    } catch (const std::exception& error) {
        result = Writer().put(type_of_current_exception()).put(error.what());
    } catch (...) {
        result = Writer().put(type_of_current_exception()).put("");
    }
    return "threw";
}

}  // namespace

Reader request(const char* name, const Writer& arguments) {
    static const char zeros[64] = {};
    bool const unwinding = std::uncaught_exceptions() > 0;  // another exception would terminate the program
    auto const& bytes = arguments.bytes();
    switch (volery_request(name, bytes.data(), bytes.size(), unwinding)) {
        case VOLERY_REPLY: break;
        case VOLERY_CANCEL: throw Cancelled{};
        case VOLERY_FAIL:
            if (unwinding) return Reader(zeros, sizeof zeros);
            throw Error(std::string(volery_current_fiber()->reply, volery_current_fiber()->reply_size));
        default:
            throw std::logic_error(std::string(name) + ": a component has one flow of control; it makes no requests "
                                   "before main() or in a thread of its own");
    }
    return Reader(volery_current_fiber()->reply, volery_current_fiber()->reply_size);
}

bool try_request(const char* name, const Writer& arguments) noexcept {
    auto const& bytes = arguments.bytes();
    return volery_request(name, bytes.data(), bytes.size(), true) == VOLERY_REPLY;
}

std::int64_t register_callable(Callable callable) {
    auto const number = callables().next++;
    register_callable_as(number, std::move(callable));
    return number;
}

void register_callable_as(std::int64_t number, Callable callable) {
    callables().by_number[number] = std::make_shared<Callable>(std::move(callable));
}

void unregister_callable(std::int64_t number) { callables().by_number.erase(number); }

}  // namespace volery

extern "C" void volery_component_dispatch(volery_fiber* fiber) {
    volery::Writer result;
    // The callable's own requests overwrite the reply, so the argument is copied.
    std::string const argument(fiber->reply, fiber->reply_size);
    const char* outcome = volery::run(fiber->callable, {argument.data(), argument.size()}, result);
    volery_return(fiber, outcome, result.bytes().data(), result.bytes().size());
}
