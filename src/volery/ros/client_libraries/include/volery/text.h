// Texts that are made as printf makes them.
#pragma once
#include <cstdarg>
#include <cstdio>
#include <string>
#include <vector>

namespace volery {

__attribute__((format(printf, 1, 2))) inline std::string formatted(const char* format, ...) {
    std::va_list arguments, again;
    va_start(arguments, format);
    va_copy(again, arguments);
    std::vector<char> text(static_cast<std::size_t>(std::vsnprintf(nullptr, 0, format, arguments)) + 1);
    std::vsnprintf(text.data(), text.size(), format, again);
    va_end(again);
    va_end(arguments);
    return text.data();
}

}  // namespace volery
