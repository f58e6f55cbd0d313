// A component that is a program of its own: running the component is calling its main().
#include "volery/abi.h"

// main() may not be named in C++; both of its forms may be called like this.
int volery_user_main(int count, char** arguments) __asm__("main");

namespace {

bool const registered = [] {
    volery::register_callable_as(volery::MAKE, [](volery::Reader, volery::Writer&) {});
    volery::register_callable_as(volery::RUN, [](volery::Reader argument, volery::Writer& result) {
        static std::string name = argument.text();
        static char* arguments[] = {name.data(), nullptr};
        result.put(volery_user_main(1, arguments));
    });
    return true;
}();

}  // namespace
