// In place of Boost's header where Boost is not installed.
#pragma once
#include <functional>

namespace boost {

using std::function;

}  // namespace boost
