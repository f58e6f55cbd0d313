// The part of the border that is linked into each component's library: what the house may call there.
#include <cxxabi.h>

#include <cstdlib>
#include <memory>
#include <typeinfo>

#include "volery/border.h"

namespace volery {
namespace {

struct Callables {
    std::unordered_map<std::int64_t, std::shared_ptr<Callable>> by_number;
    std::int64_t next = FREE;
};

// Never destroyed: other static objects may still say goodbye when the program ends.
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

// How a callable ended, and what it has to say.
const char* run(std::int64_t number, Reader argument, Writer& result) {
    try {
        auto found = callables().by_number.find(number);
        if (found == callables().by_number.end()) throw std::logic_error("nothing to call has this number");
        auto const callable = found->second;  // it may forget itself while it runs
        (*callable)(argument, result);
        return "returned";
    } catch (const Ended&) {
        return "ended";
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

Reader ask(const char* question, const Writer& with) {
    static const char no[64] = {};
    bool const unwinding = std::uncaught_exceptions() > 0;  // what is thrown now would end the program
    auto const& bytes = with.bytes();
    switch (volery_ask(question, bytes.data(), bytes.size(), unwinding)) {
        case VOLERY_ANSWER: break;
        case VOLERY_END: throw Ended{};
        case VOLERY_FAIL:
            if (unwinding) return Reader(no, sizeof no);
            throw Error(std::string(volery_here()->reply, volery_here()->reply_size));
        default:
            throw std::logic_error(std::string(question) + ": a component has one flow of control: nothing is asked "
                                   "before main() or in a thread of its own");
    }
    return Reader(volery_here()->reply, volery_here()->reply_size);
}

bool tell(const char* question, const Writer& with) noexcept {
    auto const& bytes = with.bytes();
    return volery_ask(question, bytes.data(), bytes.size(), true) == VOLERY_ANSWER;
}

std::int64_t enlist(Callable callable) {
    auto const number = callables().next++;
    enlist_as(number, std::move(callable));
    return number;
}

void enlist_as(std::int64_t number, Callable callable) {
    callables().by_number[number] = std::make_shared<Callable>(std::move(callable));
}

void forget(std::int64_t number) { callables().by_number.erase(number); }

}  // namespace volery

extern "C" void volery_component_dispatch(volery_flow* flow) {
    volery::Writer result;
    // The reply is gone once the callable asks something itself: keep it.
    std::string const argument(flow->reply, flow->reply_size);
    const char* how = volery::run(flow->callable, {argument.data(), argument.size()}, result);
    volery_return(flow, how, result.bytes().data(), result.bytes().size());
}
