// A component that is a program of its own: running the component is calling its main().
#include "volery/abi.h"

// main() may not be named in C++; both of its forms may be called like this.
int volery_user_main(int count, char** arguments) __asm__("main");

namespace {

bool const registered = [] {
    volery::register_callable_as(volery::MAKE, [](volery::Reader, volery::Writer&) {});
    volery::register_callable_as(volery::RUN, [](volery::Reader argument, volery::Writer& result) {
        static std::vector<std::string> texts(static_cast<std::size_t>(argument.integer()));
        static std::vector<char*> arguments;  // with a null at the end, as of any main()
        for (auto& text : texts) text = argument.text();
        for (auto& text : texts) arguments.push_back(text.data());
        arguments.push_back(nullptr);
        result.put(volery_user_main(static_cast<int>(texts.size()), arguments.data()));
    });
    return true;
}();

}  // namespace
